"""The head-on approach: P, an obstacle's flat face, and the goal behind it.

    M c'' = f(c, s) - K_r (L + c) - D_r c'

with c the distance of P from the face and L what is left to go behind it, from
the face to the follow point. The attraction is linear along the line.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from analysis.laws.radial_law import RadialLaw, radial_law
from diagrams import Scenario
from systems.framework.input_error import InputError
from systems.world.geometry import control_point


@dataclass(frozen=True, eq=False)
class HeadOn:
    """Contact mode in one dimension."""

    scenario: Scenario
    """Gains and mass."""
    law: RadialLaw
    """Its law."""
    to_go_m: float
    """L, m."""
    equilibria_m: tuple[float, ...]
    """Distances at which P rests, m, farthest first."""

    @property
    def equilibrium_m(self) -> float:
        """Where an approach is held up: the farthest stable equilibrium, m.

        Raises:
            InputError: There is none: the attraction overcomes the obstacle.
        """
        held = [c for c in self.equilibria_m if self.slope(c) < 0.0]
        if not held:
            raise InputError(
                "law",
                f"{self.law.name!r} does not hold P before an obstacle with "
                f"{self.to_go_m:.2f} m to go behind it; lower "
                "attraction.stiffness_n_m, raise the law's stiffness, or bring the "
                "source nearer",
            )
        return held[0]

    @property
    def stiffness_n_m(self) -> float:
        """K_r - df/dc at the equilibrium, N/m."""
        return -self.slope(self.equilibrium_m)

    def slope(self, c: float) -> float:
        """df/dc - K_r at a distance and at rest, N/m; negative: P is pushed back."""
        slope, _ = self.law.gradient(c, 0.0)
        return slope - self.scenario.follower.attraction.stiffness_n_m

    def force(self, c: float, s: float = 0.0) -> float:
        """f(c, s) - K_r (L + c), N: what moves P away from the face.

        Args:
            c: Distance of P from the face, m.
            s: Speed of the obstacle as the law takes it, m/s.

        Returns:
            N, positive away from the face.
        """
        pull = self.scenario.follower.attraction.stiffness_n_m * (self.to_go_m + c)
        return self.law.force(c, s) - pull


def head_on(scenario: Scenario, *, to_go_m: float | None = None) -> HeadOn:
    """The head-on approach with the scenario's gains.

    Args:
        scenario: Law, attraction and mass.
        to_go_m: L; none: that of the obstacle nearest to the way from the start
            to the source, or half the way where there is none.

    Returns:
        The approach, with the distances at which P rests, m.

    Raises:
        InputError: The law is not known.
        InputError: The law has no radial force, or L is negative.
    """
    if to_go_m is None:
        to_go_m = _to_go(scenario)
    if to_go_m < 0.0:
        raise InputError("to_go_m", f"{to_go_m} must not be negative")
    law = radial_law(scenario)
    stiffness = scenario.follower.attraction.stiffness_n_m
    pull = stiffness * (to_go_m + law.distances_m)
    return HeadOn(scenario, law, to_go_m, radial_equilibria(law, pull))


def radial_equilibria(law: RadialLaw, pull_n: NDArray[np.float64]) -> tuple[float, ...]:
    """Distances at which f(c, 0) equals a pull, farthest first, m.

    Args:
        law: Tabulated law.
        pull_n: (n,) pull towards the obstacle at ``law.distances_m``, N.

    Returns:
        m; empty where push and pull are never equal.
    """
    balance = law.forces_n - pull_n
    crossings = np.flatnonzero(np.diff(np.sign(balance)))
    x = law.distances_m

    def between(k: int) -> float:
        if balance[k] == 0.0:
            return float(x[k])
        return float(
            brentq(
                lambda c: np.interp(c, x[k : k + 2], balance[k : k + 2]), *x[k : k + 2]
            )
        )

    return tuple(between(k) for k in crossings[::-1] if x[k + 1] > 0.0)


def _to_go(scenario: Scenario) -> float:
    x, y = control_point(scenario.only.start.pose, scenario.only.robot.control_point_m)
    sx, sy, _ = scenario.source.path().pose(0.0)
    way = max(math.hypot(sx - x, sy - y), 1e-9)
    follow = scenario.follower.attraction.follow_distance_m
    nearest, left = math.inf, 0.5 * (way - follow)
    for obstacle in scenario.obstacles:
        ox, oy, _ = obstacle.path().pose(0.0)
        along = ((ox - x) * (sx - x) + (oy - y) * (sy - y)) / way
        aside = abs((ox - x) * (sy - y) - (oy - y) * (sx - x)) / way
        if 0.0 < along < way and aside < nearest:
            nearest, left = aside, way - along - follow
    return max(left, 0.0)
