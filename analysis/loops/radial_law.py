"""Tables of the radial force f(c, s) of a law, and of the energy of f(c, 0).

The distance of the obstacle is c, and its relative speed is s. The tables contain
forces that the law of the controller returns. Therefore, code that evaluates thousands
of starts does not need a second implementation of the law.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.autodiffutils import AutoDiffXd

from diagrams import Scenario
from diagrams.building.laws import make_controller
from diagrams.scenario.own_code import loaded_digests
from systems.framework.input_error import InputError

#: Step between the distances of ``forces_n``, m. For the default laws, linear
#: interpolation between two entries has an error of less than 1e-5 N. For the force
#: K_0/c near 3 cm, the error is less than 4e-4 N.
DISTANCE_STEP_M = 2e-4
#: Steps between the distances, m, and between the speeds, m/s, of ``increments_n``.
INCREMENT_STEPS = (2e-3, 0.01)


@dataclass(frozen=True, eq=False)
class RadialLaw:
    """The force f(c, s) of a law away from an obstacle.

    The distance of the obstacle is c, m, and its relative speed that the law uses is s,
    m/s.
    """

    name: str
    function: Callable[[Any, Any], Any]
    """The function f(c, s) of the controller, N, for floats and for AutoDiffXd."""
    range_m: float
    """Largest range of the sensors, m."""
    top_speed_m_s: float
    """Top speed of the robot, m/s. ``increments_n`` covers the speeds up to it."""

    @cached_property
    def distances_m(self) -> NDArray[np.float64]:
        """(n,) distances 0, DISTANCE_STEP_M, and so on up to ``range_m``, m."""
        count = round(self.range_m / DISTANCE_STEP_M) + 1
        return DISTANCE_STEP_M * np.arange(count, dtype=float)

    @cached_property
    def forces_n(self) -> NDArray[np.float64]:
        """(n,) force f(c, 0) at ``distances_m``, N; first the limit at 0."""
        distances = np.maximum(self.distances_m, 1e-9).tolist()
        forces = np.array([float(self.function(c, 0.0)) for c in distances])
        if not np.all(np.isfinite(forces)):
            raise InputError(
                "law",
                f"{self.name!r} gives a force that is not finite; bound the force",
            )
        return forces

    @cached_property
    def energies_j(self) -> NDArray[np.float64]:
        """(n,) work of the force f(c, 0) from ``distances_m`` to ``range_m``, J."""
        work = 0.5 * DISTANCE_STEP_M * (self.forces_n[1:] + self.forces_n[:-1])
        return np.append(np.cumsum(work[::-1])[::-1], 0.0)

    @cached_property
    def increments_n(self) -> NDArray[np.float64]:
        """(n, k) velocity term f(c, s) - f(c, 0), N.

        Row i has the distance i INCREMENT_STEPS[0]. Column j has the speed j
        INCREMENT_STEPS[1].
        """
        dc, ds = INCREMENT_STEPS
        # The force of a law may jump, for example at rho_0. Therefore, users of the
        # table take the row of the nearest distance and do not interpolate rows.
        rows = np.maximum(dc * np.arange(round(self.range_m / dc) + 1), 1e-9).tolist()
        speeds = (ds * np.arange(int(np.ceil(self.top_speed_m_s / ds)) + 2)).tolist()
        table = np.array([[float(self.function(c, s)) for s in speeds] for c in rows])
        return table - table[:, :1]

    @cached_property
    def stiffest(self) -> tuple[float, float]:
        """Distance at which the law is stiffest, m, and its stiffness there, N/m.

        The stiffness is the largest slope -df/dc for an obstacle at rest. It is at most
        0 if the force never grows as the obstacle comes nearer.
        """
        slopes = -np.diff(self.forces_n) / DISTANCE_STEP_M
        k = int(slopes.argmax())
        best = float(self.distances_m[k]), float(slopes[k])
        # The mean slope of a step is less than the slope at its steeper end.
        inside = 1e-6 * DISTANCE_STEP_M
        for c in (self.distances_m[k] + inside, self.distances_m[k + 1] - inside):
            slope = -self.gradient(float(c), 0.0)[0]
            if slope > best[1]:
                best = float(c), slope
        return best

    @property
    def stiffest_n_m(self) -> float:
        """Largest stiffness -df/dc for an obstacle at rest, N/m; see ``stiffest``."""
        return self.stiffest[1]

    def force(self, c: float, s: float = 0.0) -> float:
        """Returns f(c, s), N, positive away from the obstacle; 0 beyond the sensors."""
        return float(self.function(c, s)) if c <= self.range_m else 0.0

    def at_rest(self, c: ArrayLike) -> NDArray[np.float64]:
        """Interpolates ``forces_n``, N, at many distances c, m."""
        return np.interp(np.asarray(c), self.distances_m, self.forces_n, right=0.0)

    def energy(self, c: ArrayLike) -> NDArray[np.float64]:
        """Interpolates ``energies_j``, J, at many distances c, m."""
        return np.interp(np.asarray(c), self.distances_m, self.energies_j, right=0.0)

    def gradient(self, c: float, s: float) -> tuple[float, float]:
        """Returns the partial derivatives df/dc, N/m, and df/ds, N s/m, of ``force``.

        At s = 0, the derivative by s is the one-sided derivative for s > 0.
        """
        f = self.function(AutoDiffXd(c, np.eye(2)[0]), AutoDiffXd(s, np.eye(2)[1]))
        slopes = f.derivatives() if isinstance(f, AutoDiffXd) else np.zeros(0)
        return (float(slopes[0]), float(slopes[1])) if len(slopes) else (0.0, 0.0)


def radial_law(scenario: Scenario) -> RadialLaw:
    """Returns the force of a scenario's law, up to the sensor range and top speed."""
    key = scenario.model_copy(update={"name": "", "description": "", "seed": 0})
    sensor = key.follower.ultrasonic
    return _radial_law(
        key.only.law,
        str(loaded_digests(key)),
        key.follower.laws.model_dump_json(),
        (sensor.minimum_range_m, sensor.maximum_range_m),
        key.only.robot.top_speed_m_s,
        _Scenario(key),
    )


class _Scenario:
    """Carries a scenario into a cached function without being part of the key."""

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Scenario)

    def __hash__(self) -> int:
        return 0


@lru_cache(maxsize=64)
def _radial_law(
    name: str,
    _own_code: str,
    _gains: str,
    ranges_m: tuple[float, float],
    top_speed: float,
    carrier: _Scenario,
) -> RadialLaw:
    controller = make_controller(carrier.scenario)
    function = getattr(controller, "radial_force", None)
    if function is None:
        raise InputError(
            "law",
            f"{name!r} is a block without a force f(c, s), which energy "
            "functions need; write it as a function law(c, s, laws)",
        )
    return RadialLaw(name, function, ranges_m[1], top_speed)
