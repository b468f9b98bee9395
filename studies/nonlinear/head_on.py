"""Model of a robot that drives straight toward the flat face of an obstacle.

The goal is behind the obstacle. The motion of the control point P, which is ahead of
the axle, obeys this equation:

    M c'' = f(c, s) - K_r (L + c) - D_r c'

- M is the virtual mass at P.
- c is the distance of P from the face.
- L is the distance from the face to the follow point behind it.
- f is the force of the law, and s is the relative speed of the obstacle.
- K_r is the stiffness and D_r is the damping of the attraction to the follow point.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from analysis.loops.radial_law import RadialLaw, radial_law
from diagrams import Scenario
from systems.framework.input_error import InputError
from systems.world.geometry import control_point


@dataclass(frozen=True, eq=False)
class HeadOn:
    """Straight approach of a robot to the flat face of an obstacle.

    The module docstring defines the equation of motion and its symbols.
    """

    scenario: Scenario
    law: RadialLaw
    to_go_m: float
    """Distance L from the face to the follow point, m."""
    equilibria_m: tuple[float, ...]
    """Distances at which P can rest, m, largest first."""

    @property
    def equilibrium_m(self) -> float:
        """Distance from the obstacle at which the robot stops, m.

        The robot stops at the stable equilibrium that is farthest from the obstacle.
        Raises InputError if there is none, because the attraction is stronger than the
        push.
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

        ``c`` is the distance of P from the face, m. An equilibrium with a negative
        slope is stable.
        """
        slope, _ = self.law.gradient(c, 0.0)
        return slope - self.scenario.follower.attraction.stiffness_n_m

    def force(self, c: float, s: float = 0.0) -> float:
        """Returns the net force f(c, s) - K_r (L + c), N, positive away from the face.

        ``c`` is the distance of P from the face, m. ``s`` is the relative speed of the
        obstacle that the law uses, m/s.
        """
        pull = self.scenario.follower.attraction.stiffness_n_m * (self.to_go_m + c)
        return self.law.force(c, s) - pull


def head_on(scenario: Scenario, *, to_go_m: float | None = None) -> HeadOn:
    """Makes the model of a straight approach to an obstacle from a scenario.

    ``to_go_m`` is the distance L from the face to the follow point. By default, L is
    that of the obstacle nearest to the line from the start to the source. Without such
    an obstacle, L is half the distance from the start to the follow point. Raises
    InputError if L is negative or the law has no radial force.
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
    """Returns the distances at which push and pull are equal, m, largest first.

    ``pull_n`` is the (n,) pull toward the obstacle at ``law.distances_m``.
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
