"""A law's radial force as tables: f(c, s), and the energy of f(c, 0).

The tables hold what the controller's own law returns, so that loops over
thousands of starts need no second copy of it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.autodiffutils import AutoDiffXd

from diagrams import Scenario
from diagrams.building.laws import make_controller
from diagrams.scenario.own_code import loaded_digests
from systems.framework.input_error import InputError

#: Spacing of ``forces_n``, m. Linear interpolation of the default laws between
#: two entries errs by less than 1e-5 N; of K_0/c near 3 cm by less than 4e-4 N.
DISTANCE_STEP_M = 2e-4
#: Spacing of ``increments_n``, m and m/s.
INCREMENT_STEPS = (2e-3, 0.01)


@dataclass(frozen=True, eq=False)
class RadialLaw:
    """Force away from an obstacle at distance c, whose vector changes at s."""

    name: str
    """The scenario's ``law``."""
    function: Callable[[Any, Any], Any]
    """f(c, s), N: the controller's own, for floats and AutoDiffXd."""
    range_m: float
    """Beyond it no obstacle is sensed, m."""
    forces_n: NDArray[np.float64]
    """f(c, 0) at c = 0, DISTANCE_STEP_M, ... up to the range, N."""
    energies_j: NDArray[np.float64]
    """U(c): work of f(., 0) from c to the range, at the same distances, J."""
    increments_n: NDArray[np.float64]
    """f(c, s) - f(c, 0) at multiples of INCREMENT_STEPS, N; rows by c."""

    @property
    def distances_m(self) -> NDArray[np.float64]:
        """Distances of ``forces_n`` and ``energies_j``, m."""
        return DISTANCE_STEP_M * np.arange(len(self.forces_n), dtype=float)

    def force(self, c: float, s: float = 0.0) -> float:
        """f(c, s); 0 beyond the range.

        Args:
            c: Distance, m.
            s: Speed of the obstacle as the law takes it, m/s.

        Returns:
            N, positive away from the obstacle.
        """
        return float(self.function(c, s)) if c <= self.range_m else 0.0

    def at_rest(self, c: ArrayLike) -> NDArray[np.float64]:
        """f(c, 0) in N of many distances, by interpolation."""
        return np.interp(np.asarray(c), self.distances_m, self.forces_n, right=0.0)

    def energy(self, c: ArrayLike) -> NDArray[np.float64]:
        """U(c) in J, by interpolation."""
        return np.interp(np.asarray(c), self.distances_m, self.energies_j, right=0.0)

    def gradient(self, c: float, s: float) -> tuple[float, float]:
        """Slopes of f(c, s); at s = 0 the one towards s > 0.

        Args:
            c: Distance, m.
            s: Speed of the obstacle as the law takes it, m/s.

        Returns:
            df/dc, N/m, and df/ds, N s/m.
        """
        f = self.function(AutoDiffXd(c, np.eye(2)[0]), AutoDiffXd(s, np.eye(2)[1]))
        slopes = f.derivatives() if isinstance(f, AutoDiffXd) else np.zeros(0)
        return (float(slopes[0]), float(slopes[1])) if len(slopes) else (0.0, 0.0)


def law_function(scenario: Scenario) -> Callable[[Any, Any], Any]:
    """f(c, s) of the scenario's controller, N.

    Raises:
        InputError: The law is not known.
        InputError: It is a block of its own that has no radial law.
    """
    controller = make_controller(scenario)
    function = getattr(controller, "radial_force", None)
    if function is None:
        raise InputError(
            "law",
            f"{scenario.only.law!r} is a block without a force f(c, s), which energy "
            "functions need; write it as a function law(c, s, laws)",
        )
    return function


def radial_law(scenario: Scenario) -> RadialLaw:
    """Tabulates the scenario's law up to the sensors' range and the top speed.

    Raises:
        InputError: The law is not known.
        InputError: It has no radial force, or one that is not finite.
    """
    key = scenario.model_copy(update={"name": "", "description": "", "seed": 0})
    return _tabulate(
        key.only.law,
        str(loaded_digests(key)),
        key.follower.laws.model_dump_json(),
        (
            key.follower.ultrasonic.minimum_range_m,
            key.follower.ultrasonic.maximum_range_m,
        ),
        key.only.robot.top_speed_m_s,
        _Scenario(key),
    )


class _Scenario:
    """Carries a scenario past the cache: all of them are alike to it."""

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Scenario)

    def __hash__(self) -> int:
        return 0


@lru_cache(maxsize=64)
def _tabulate(
    name: str,
    _own_code: str,
    _gains: str,
    ranges_m: tuple[float, float],
    top_speed: float,
    carrier: _Scenario,
) -> RadialLaw:
    range_m = ranges_m[1]
    function = law_function(carrier.scenario)
    count = round(range_m / DISTANCE_STEP_M) + 1
    distances = DISTANCE_STEP_M * np.arange(count)
    distances[0] = 1e-9
    forces = np.array([float(function(c, 0.0)) for c in distances.tolist()])
    if not np.all(np.isfinite(forces)):
        raise InputError(
            "law", f"{name!r} gives a force that is not finite; bound the force"
        )
    work = 0.5 * DISTANCE_STEP_M * (forces[1:] + forces[:-1])
    energies = np.append(np.cumsum(work[::-1])[::-1], 0.0)
    increments = _increments(function, range_m, top_speed)
    return RadialLaw(name, function, range_m, forces, energies, increments)


def _increments(
    function: Callable[[Any, Any], Any], range_m: float, top_speed: float
) -> NDArray[np.float64]:
    dc, ds = INCREMENT_STEPS
    # Between two distances the nearer one counts: laws may step, as at rho_0.
    distances = np.maximum(dc * np.arange(round(range_m / dc) + 1), 1e-9).tolist()
    speeds = (ds * np.arange(int(np.ceil(top_speed / ds)) + 2)).tolist()
    table = np.array([[float(function(c, s)) for s in speeds] for c in distances])
    return table - table[:, :1]
