"""The law of Engelbrecht 2021 whose gains adapt."""

from __future__ import annotations

from typing import Literal

from systems.framework.parameters import NonNegative, Parameters
from systems.laws.law import Equation
from systems.laws.trajectory.trajectory_conventional import (
    TrajectoryImpedanceParameters,
    trajectory_law,
)


class AdaptationParameters(Parameters):
    """Parameters of the adaptation. The paper prints no rates and no limits."""

    rule: Literal["lyapunov", "sensitivity"] = "lyapunov"
    """Rule that adapts the gains.

    ``lyapunov`` is a Lyapunov rule: eq. 40 to 42 of Engelbrecht 2021 as printed.
    ``sensitivity`` uses the gradient of eq. 27 with the sensitivities that eq. 34
    intends.

    With ``sensitivity``, the damping of a contact is 0 at the edge of the zone and
    grows toward the object, because sensitivities need a force without jumps.
    """
    rate: NonNegative = 10.0
    """Rate gamma = eta/T of K and D. The unit is (N/m)^2/(m^2 s) for the rule
    ``sensitivity`` and (N/m)^2 s^2/m^2 for the rule ``lyapunov``."""
    contact_rate: NonNegative = 0.0
    """Rate gamma of K_e, in the unit of ``rate``. With 0, K_e is fixed."""
    penalty: NonNegative = 0.0
    """Weight lambda of the safety term, without unit. With 0 the term is off.

    For each object at the distance d, the term is lambda/2 max(0, S - d)^2, where S is
    ``impedance.security_zone_m``. It replaces the term lambda/2 (d_sec^2 - d^2) of eq.
    27 of Engelbrecht 2021. Its gradient is -lambda (S - d) n, where n is the unit
    vector from the object to P.

    The term has an effect only with ``rule: sensitivity``. Without the term, a robot
    with adaptive gains collides more often than a robot with fixed gains.
    """
    projected: bool = False
    """Whether the gains have limits: K from 0.5 to 6 N/m, D from 3 to 8 N s/m, and K_e
    from 0.5 to 24 N/m.
    """
    safety_filter: bool = False
    """Whether ``SafetyFilter`` keeps P away from objects, whatever the gains."""


class AdaptiveTrajectoryParameters(AdaptationParameters, TrajectoryImpedanceParameters):
    """Parameters of the adaptive law. The paper prints no rates and no limits."""

    @property
    def damping_fades(self) -> bool:
        """Whether contact damping is 0 at the edge of the zone: with sensitivities."""
        return self.rule == "sensitivity"


TRAJECTORY_ADAPTIVE = trajectory_law(
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
    gains=AdaptationParameters,
)
