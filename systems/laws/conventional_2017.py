"""The conventional virtual-impedance law of Kim 2017: gains, force, and equation."""

from __future__ import annotations

from typing import Any

from systems.framework.parameters import Damping, Parameters, Positive
from systems.laws.law import Equation, Law, Tuning


class Conventional2017Parameters(Parameters):
    """Gains of a law whose force has the term K_0/distance (Kim 2017, eq. 20).

    Kim 2017 does not print the gains.
    """

    distance_gain_j: Positive = 0.917
    """Gain K_0 of the push K_0/c, J. Han's laws use the symbol K_0 for a stiffness."""
    damping_n_s_m: Damping = 0.8
    """Damping D_0, N s/m."""


def conventional_2017_force(
    c: Any, s: Any, gains: Conventional2017Parameters, least_range_m: float
) -> Any:
    """Computes the force K_0/c + D_0 s at any distance c (Kim 2017, eq. 20).

    As printed, the term K_0/c becomes infinite as c approaches 0. This function keeps
    the term constant below the least range of the sensors, because sensors cannot
    distinguish shorter distances.

    The term acts at any distance. At twice the distance, it is half as large.

    Args:
        c: Distance of the obstacle, m; float or AutoDiffXd.
        s: Speed of the obstacle, m/s.
        gains: Gains of the law.
        least_range_m: Least range of the sensors, m, above 0.

    Returns:
        Force away from the obstacle, N.
    """
    nearest = c if c > least_range_m else least_range_m + 0.0 * c
    return gains.distance_gain_j / nearest + gains.damping_n_s_m * s


CONVENTIONAL_2017 = Law(
    name="conventional2017",
    title="Conventional law of 2017",
    label="conventional 2017",
    equations=(
        Equation(
            "Conventional law of 2017 (Kim 2017, eq. 20)",
            r"f = \frac{K_0}{\max(c,\,c_{min})}+D_0\,s",
            "f = K_0/max(c, c_min) + D_0 s, c_min the sensors' least range",
        ),
    ),
    force=conventional_2017_force,
    controller_name="ConventionalImpedance2017Controller",
    least_range=True,
    gains=Conventional2017Parameters,
    loop_gains=("distance_gain_j", "damping_n_s_m"),
    tuning=Tuning(rule="barrier"),
)
