"""Head-on equilibria of the active law as functions of the stiffness ratio k_ref/K_0.

k_ref is the reference stiffness of the law, and K_0 its matched stiffness. In a head-on
approach, the robot moves straight toward an obstacle that lies before the goal.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from diagrams import Scenario
from studies.nonlinear.head_on import head_on
from systems.laws.active import active_force

#: Spacing of the distances at which push and pull are compared, m.
_RATIO_STEP_M = 2e-3


@dataclass(frozen=True, eq=False)
class RatioMap:
    """Head-on equilibria of the active law over k_ref/K_0."""

    ratios: NDArray[np.float64]
    """(n,) values of k_ref/K_0. K_0 and reach are those of the scenario."""
    outer_m: NDArray[np.float64]
    """(n,) distances at which the obstacle stops the robot, m, or NaN. This equilibrium
    is a saddle, because the robot can slip sideways."""
    inner_m: NDArray[np.float64]
    """(n,) smaller distances at which the decreasing push no longer holds the robot, m,
    or NaN. This equilibrium is a source."""
    to_go_m: float
    """Distance from the obstacle's face to the goal behind the obstacle, m."""
    today: float
    """Ratio k_ref/K_0 in the scenario."""


def stiffness_ratio_map(
    scenario: Scenario,
    ratios: Sequence[float] = tuple(np.geomspace(1.2, 64.0, 60)),
    *,
    to_go_m: float | None = None,
) -> RatioMap:
    """Computes the head-on equilibria of the active law over the ratio k_ref/K_0.

    Args:
        scenario: Scenario with stiffness K_0 and reach of the active law.
        ratios: Ratios k_ref/K_0 of the active law's two stiffnesses, above 1.
        to_go_m: Distance from the obstacle's face to the goal, m, see ``head_on``.

    Returns:
        Distances of the equilibria from the obstacle for each ratio, m. If there is no
        equilibrium, the distance is NaN.
    """
    contact = head_on(scenario.with_robot(law="active"), to_go_m=to_go_m)
    gains = scenario.follower.laws.active
    stiffness = scenario.follower.attraction.stiffness_n_m
    c = np.arange(_RATIO_STEP_M, contact.law.range_m, _RATIO_STEP_M)
    pull = stiffness * (contact.to_go_m + c)
    outer, inner = [], []
    for ratio in ratios:
        k_ref = float(ratio) * gains.matched_stiffness_n_m
        case = gains.model_copy(update={"reference_stiffness_n_m": k_ref})
        force = np.array([active_force(value, 0.0, case) for value in c.tolist()])
        places = _crossings(c, force - pull)
        outer.append(max(places["down"], default=math.nan))
        inner.append(max(places["up"], default=math.nan))
    return RatioMap(
        np.array(ratios, dtype=float),
        np.array(outer),
        np.array(inner),
        contact.to_go_m,
        gains.reference_stiffness_n_m / gains.matched_stiffness_n_m,
    )


def _crossings(
    x: NDArray[np.float64], y: NDArray[np.float64]
) -> dict[str, list[float]]:
    """Zeros of y on the way up and on the way down, by linear interpolation."""
    at = np.flatnonzero(np.diff(np.sign(y)))
    places = x[at] - y[at] * (x[at + 1] - x[at]) / (y[at + 1] - y[at])
    up = y[at + 1] > y[at]
    return {"up": places[up].tolist(), "down": places[~up].tolist()}
