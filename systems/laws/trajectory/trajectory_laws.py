"""The laws of robots on routes: one controller, also with adaptation or a filter."""

from __future__ import annotations

from systems.laws.law import Equation, Law
from systems.laws.trajectory.parameters import (
    AdaptiveTrajectoryParameters,
    ConventionalTrajectoryParameters,
    FilteredTrajectoryParameters,
    TrajectoryImpedanceParameters,
)

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
        controller_name="TrajectoryImpedanceController",
        robot="router",
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
