"""The conventional virtual-impedance law of Kim 2017: gains, force and equation."""

from __future__ import annotations

from typing import Any

from systems.framework.parameters import Damping, Parameters, Positive
from systems.laws.law import Equation, Law, Tuning


class Conventional2017Parameters(Parameters):
    """Push that grows with nearness without a bound (Kim 2017, eq. 20).

    Kim 2017 prints neither gain.
    """

    distance_gain_j: Positive = 0.917
    """K_0, J: the push is K_0/c. Not the K_0 of Han's laws."""
    damping_n_s_m: Damping = 0.8
    """D_0, N s/m."""


def conventional_2017_force(
    c: Any, s: Any, gains: Conventional2017Parameters, least_range_m: float
) -> Any:
    """K_0/c + D_0 s, at any distance (Kim 2017, eq. 20).

    As printed, the push has no bound as c approaches 0. The least range of the sensors
    bounds it, because the sensors cannot distinguish distances below that range.

    Args:
        c: Distance of the obstacle, m; float or AutoDiffXd.
        s: Its speed, m/s.
        gains: K_0, D_0.
        least_range_m: Least range of the sensors, m, above 0.

    Returns:
        Force away from the obstacle, N: at most K_0/least_range_m at rest. Its reach
        has no end: the push halves when the distance doubles.
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
    tuning=Tuning(
        rule="barrier",
        # K_0/c^2 just outside of the least range.
        stiffest=lambda gains, least_range_m: gains.distance_gain_j / least_range_m**2,
    ),
)
