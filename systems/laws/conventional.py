"""The conventional virtual-impedance law of Han 2019: gains, force, and equation."""

from __future__ import annotations

from typing import Any

from systems.framework.parameters import Damping, Length, Parameters, Stiffness
from systems.laws.law import Equation, Law, Tuning


class ConventionalParameters(Parameters):
    """Spring and damper within a reach (Han 2019, eq. 19-a)."""

    stiffness_n_m: Stiffness = 12.3
    """Stiffness K_0, N/m."""
    damping_n_s_m: Damping = 0.8
    """Damping D_0, N s/m."""
    reach_m: Length = 0.8
    """Distance rho_0 below which the law acts, m (Han 2019, 5.2)."""


def conventional_force(c: Any, s: Any, gains: ConventionalParameters) -> Any:
    """Computes the force K_0 (rho_0 - c) + D_0 s (Han 2019, eq. 19-a).

    If c is rho_0 or more, the force is 0. Therefore it jumps by D_0 s at c = rho_0.

    Args:
        c: Distance of the obstacle, m; float or AutoDiffXd.
        s: Speed of the obstacle, m/s.
        gains: Gains of the law.

    Returns:
        Force away from the obstacle, N.
    """
    if c < gains.reach_m:
        return gains.stiffness_n_m * (gains.reach_m - c) + gains.damping_n_s_m * s
    return 0.0 * c


CONVENTIONAL = Law(
    name="conventional",
    title="Conventional law",
    label="conventional",
    equations=(
        Equation(
            "Conventional law (Han 2019, eq. 19-a)",
            r"f = K_0\,(\rho_0-c)+D_0\,s\quad (c<\rho_0),"
            r"\quad f = 0\quad (c\geq\rho_0)",
            "f = K_0 (rho_0 - c) + D_0 s for c < rho_0, else 0",
        ),
    ),
    force=conventional_force,
    controller_name="ConventionalImpedanceController",
    gains=ConventionalParameters,
    loop_gains=("stiffness_n_m", "damping_n_s_m"),
    tuning=Tuning(
        rule="barrier",
        sets_follow_distance=True,
    ),
)
