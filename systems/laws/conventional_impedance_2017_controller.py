"""The conventional virtual-impedance law of 2017."""

from __future__ import annotations

from typing import Any

from systems.laws.law_controller import define_law_controller
from systems.laws.parameters import Conventional2017Parameters
from systems.laws.records import CONVENTIONAL_2017


def conventional_2017_force(
    c: Any, s: Any, gains: Conventional2017Parameters, least_range_m: float
) -> Any:
    """K_0/c + D_0 s, at any distance (Kim 2017, eq. 20).

    Printed, the push has no bound as c falls to 0. What bounds it is the least
    range of the sensors: nearer than that they tell no difference.

    Args:
        c: Distance of the obstacle, m; float or AutoDiffXd.
        s: Its speed, m/s.
        gains: K_0, D_0.
        least_range_m: Least range of the sensors, m, above 0.

    Returns:
        Force away from the obstacle, N: at most K_0/least_range_m at rest. There
        is no end to its reach: it halves when the distance doubles.
    """
    nearest = c if c > least_range_m else least_range_m + 0.0 * c
    return gains.distance_gain_j / nearest + gains.damping_n_s_m * s


ConventionalImpedance2017Controller_ = define_law_controller(
    "ConventionalImpedance2017Controller",
    __name__,
    CONVENTIONAL_2017,
    about="pushes off by inverse distance",
    reference="Kim 2017, eq. 19 (F_m) and 20",
)
ConventionalImpedance2017Controller = ConventionalImpedance2017Controller_[None]
