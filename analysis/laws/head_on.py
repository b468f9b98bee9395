"""Head-on approach of the control point P to the flat face of an obstacle.

The goal is behind the obstacle. The motion obeys this equation:

    M c'' = f(c, s) - K_r (L + c) - D_r c'

- c is the distance of P from the face, m.
- L is the distance from the face to the follow point behind it, m.
- f is the force of the law, N, and s is the speed of the obstacle in the law, m/s.

The attraction is linear along the line of the approach.
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
    """The head-on approach of the control point P to a flat face, in one dimension.

    The symbols are those of the module: c, s, L, and f(c, s).
    """

    scenario: Scenario
    """Scenario with the gains and the mass."""
    law: RadialLaw
    """Law of the scenario."""
    to_go_m: float
    """Distance L from the face to the follow point, m."""
    equilibria_m: tuple[float, ...]
    """Distances at which P can rest, m, largest first."""

    @property
    def equilibrium_m(self) -> float:
        """Distance at which the obstacle stops P, m.

        The distance is the largest one of all stable equilibria.

        Raises:
            InputError: There is no stable equilibrium, because the attraction is
                stronger than the push of the law.
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
        """Stiffness K_r - df/dc at the equilibrium, N/m."""
        return -self.slope(self.equilibrium_m)

    def slope(self, c: float) -> float:
        """Returns the slope df/dc - K_r of the net force at rest, N/m.

        Args:
            c: Distance of P from the face, m.

        Returns:
            The slope. A negative slope means that a small deviation is pushed back.
        """
        slope, _ = self.law.gradient(c, 0.0)
        return slope - self.scenario.follower.attraction.stiffness_n_m

    def force(self, c: float, s: float = 0.0) -> float:
        """Returns the net force f(c, s) - K_r (L + c) on P.

        Args:
            c: Distance of P from the face, m.
            s: Speed of the obstacle in the law, m/s.

        Returns:
            The force in N, positive away from the face.
        """
        pull = self.scenario.follower.attraction.stiffness_n_m * (self.to_go_m + c)
        return self.law.force(c, s) - pull


def head_on(scenario: Scenario, *, to_go_m: float | None = None) -> HeadOn:
    """Makes the head-on approach with the gains of a scenario.

    Args:
        scenario: The scenario with the law, the attraction, and the mass.
        to_go_m: Distance L from the face to the follow point, m. If it is None, L comes
            from the obstacle that is nearest to the line from the start to the source.
            Without such an obstacle, L is half the distance from the start to the
            follow point.

    Returns:
        The approach, with the distances at which P can rest, m.

    Raises:
        InputError: The law does not exist.
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
    """Returns the distances at which the push f(c, 0) is equal to a given pull.

    Args:
        law: The tabulated law.
        pull_n: (n,) pull toward the obstacle at the distances ``law.distances_m``, N.

    Returns:
        The distances in m, largest first. If push and pull are never equal, the tuple
        is empty.
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
