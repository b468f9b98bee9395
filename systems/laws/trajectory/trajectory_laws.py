"""The laws of robots on routes: one controller, with adaptation or with a filter."""

from __future__ import annotations

from typing import Literal

from systems.framework.parameters import Length, NonNegativeStiffness
from systems.laws.law import Equation, Law
from systems.laws.trajectory.impedance_adaptation import AdaptationParameters
from systems.laws.trajectory.reference_model import ReferenceModelParameters
from systems.laws.trajectory.trajectory_impedance import TrajectoryImpedanceParameters
from systems.laws.trajectory.trajectory_impedance_controller import (
    TrajectoryImpedanceController,
)
from systems.planning.safety_filter import SafetyFilterParameters

__all__ = [
    "TRAJECTORY_ADAPTIVE",
    "TRAJECTORY_CONVENTIONAL",
    "TRAJECTORY_FILTERED",
    "AdaptiveTrajectoryParameters",
    "ConventionalTrajectoryParameters",
    "FilteredTrajectoryParameters",
    "PrintedAdaptationParameters",
]


class ConventionalTrajectoryParameters(TrajectoryImpedanceParameters):
    """As in the paper, with the signs restored: K_e = K, S of table 1."""

    contact_stiffness_n_m: NonNegativeStiffness = 3.0
    """K_e to robots and obstacles, N/m."""
    security_zone_m: Length = 1.0
    """S, m."""
    damping_fades: bool = False
    """Switched on at the edge of the zone, as it is printed."""


class PrintedAdaptationParameters(AdaptationParameters):
    """How K, D and K_e adapt: as eq. 40 to 42 are printed, unless ``rule`` is set."""

    rule: Literal["none", "lyapunov", "sensitivity"] = "lyapunov"
    """Nothing adapts; eq. 40 to 42 as they are printed, which is a Lyapunov rule; or
    the gradient of eq. 27 by the sensitivities that eq. 34 means."""


class AdaptiveTrajectoryParameters(ConventionalTrajectoryParameters):
    """The same with the adaptation that eq. 40 to 42 print."""

    adaptation: PrintedAdaptationParameters = PrintedAdaptationParameters()
    """How K, D and K_e adapt."""
    reference: ReferenceModelParameters = ReferenceModelParameters()
    """What they adapt to."""
    safety_filter: SafetyFilterParameters | None = None
    """Keeps P off objects, whatever the impedance; null: nothing does."""


class FilteredTrajectoryParameters(TrajectoryImpedanceParameters):
    """Ours: a narrower and stiffer zone, and a filter."""

    safety_filter: SafetyFilterParameters = SafetyFilterParameters()
    """Keeps P off objects, whatever the impedance."""


_IMPEDANCE = Equation(
    "Impedance to the target and to contacts",
    r"M\ddot{p}=-K(p-p_d)-D(v-v_d)+\sum_j K_e(S-d_j)\,n_j-D_e(v-v_j)",
    "M p'' = -K (p - p_d) - D (v - v_d) + sum K_e (S - d_j) n_j - D_e (v - v_j)",
)


def _law(
    name: str,
    title: str,
    label: str,
    gains: type[TrajectoryImpedanceParameters],
    *more: Equation,
) -> Law:
    return Law(
        name=name,
        title=title,
        label=label,
        equations=(_IMPEDANCE, *more),
        gains=gains,
        controller=TrajectoryImpedanceController,
        plans=True,
        on_route=True,
    )


TRAJECTORY_CONVENTIONAL = _law(
    "trajectory_conventional",
    "Trajectory impedance (Engelbrecht et al. 2021)",
    "trajectory, conventional",
    ConventionalTrajectoryParameters,
)

TRAJECTORY_ADAPTIVE = _law(
    "trajectory_adaptive",
    "Adaptive trajectory impedance (Engelbrecht et al. 2021)",
    "trajectory, adaptive",
    AdaptiveTrajectoryParameters,
    Equation(
        "Adaptation",
        r"\dot{K}=\frac{\gamma}{M}e_v\cdot(p-p_d),\quad"
        r"\dot{D}=\frac{\gamma}{M}e_v\cdot(v-v_d)",
        "K' = (gamma/M) e_v . (p - p_d), D' = (gamma/M) e_v . (v - v_d)",
    ),
)

TRAJECTORY_FILTERED = _law(
    "trajectory_filtered",
    "Filtered trajectory impedance",
    "trajectory, filtered",
    FilteredTrajectoryParameters,
    Equation(
        "Safety filter",
        r"v=\mathrm{argmin}\,|v-v^*|\quad\mathrm{with}\quad n_j\cdot v\geq b_j",
        "v = argmin |v - v*| with n_j . v >= b_j",
    ),
)
