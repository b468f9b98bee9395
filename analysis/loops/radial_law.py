"""Tables of the radial force f(c, s) of a law, and of the work of f(c, 0).

The radial force pushes the robot away from an obstacle at the distance c that moves at
the relative speed s. The tables are filled with values of the controller's own force
function. Code that needs many values therefore looks them up, and does not need a
second implementation of the law.
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
from diagrams.scenario.own_versions import loaded_digests
from systems.framework.input_error import InputError

#: Step between the distances of ``forces_n``, m. For the default laws, linear
#: interpolation between two entries has an error of less than 1e-5 N. For a force K_0/c
#: with the distance c near 3 cm, the error is less than 4e-4 N.
DISTANCE_STEP_M = 2e-4
#: Step between the distances of ``increments_n``, m, and step between its speeds, m/s.
INCREMENT_STEPS = (2e-3, 0.01)


@dataclass(frozen=True, eq=False)
class RadialLaw:
    """The force f(c, s) of a law away from an obstacle.

    c is the distance of the obstacle, m. s is the relative speed of the obstacle, m/s,
    as defined by the velocity term of the scenario.
    """

    name: str
    function: Callable[[Any, Any], Any]
    """Function f(c, s) of the controller, N. It takes floats or AutoDiffXd."""
    range_m: float
    """Largest range of the sensors, m."""
    top_speed_m_s: float
    """Top speed of the robot, m/s, up to which ``increments_n`` has columns."""

    @cached_property
    def distances_m(self) -> NDArray[np.float64]:
        """(n,) distances 0, DISTANCE_STEP_M, and so on up to ``range_m``, m."""
        count = round(self.range_m / DISTANCE_STEP_M) + 1
        return DISTANCE_STEP_M * np.arange(count, dtype=float)

    @cached_property
    def forces_n(self) -> NDArray[np.float64]:
        """(n,) forces f(c, 0) at ``distances_m``, N. The first is the limit at 0."""
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
        """(n,) work of f(c, 0) from each of ``distances_m`` to ``range_m``, J."""
        work = 0.5 * DISTANCE_STEP_M * (self.forces_n[1:] + self.forces_n[:-1])
        return np.append(np.cumsum(work[::-1])[::-1], 0.0)

    @cached_property
    def increments_n(self) -> NDArray[np.float64]:
        """(n, k) velocity term f(c, s) - f(c, 0), N.

        Row i is for the distance ``i * INCREMENT_STEPS[0]``, m, and column j is for the
        speed ``j * INCREMENT_STEPS[1]``, m/s.
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
        """Distance at which the law is stiffest, m, and the stiffness there, N/m.

        The stiffness is the largest slope -df/dc for an obstacle at rest. It is at most
        0 if the force never grows as the obstacle comes nearer.
        """
        slopes = -np.diff(self.forces_n) / DISTANCE_STEP_M
        k = int(slopes.argmax())
        best = float(self.distances_m[k]), float(slopes[k])
        # The mean slope between two distances is at most the slope at one of them.
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
        """Returns f(c, s), N, positive away from the obstacle; 0 beyond ``range_m``."""
        return float(self.function(c, s)) if c <= self.range_m else 0.0

    def at_rest(self, c: ArrayLike) -> NDArray[np.float64]:
        """Returns f(c, 0) at distances c of any shape, m, from ``forces_n``, N."""
        return np.interp(np.asarray(c), self.distances_m, self.forces_n, right=0.0)

    def energy(self, c: ArrayLike) -> NDArray[np.float64]:
        """Returns the work at distances c of any shape, m, from ``energies_j``, J."""
        return np.interp(np.asarray(c), self.distances_m, self.energies_j, right=0.0)

    def gradient(self, c: float, s: float) -> tuple[float, float]:
        """Returns the partial derivatives df/dc, N/m, and df/ds, N s/m, of f(c, s).

        At s = 0, the derivative by s is the one-sided derivative for s > 0.
        """
        f = self.function(AutoDiffXd(c, np.eye(2)[0]), AutoDiffXd(s, np.eye(2)[1]))
        slopes = f.derivatives() if isinstance(f, AutoDiffXd) else np.zeros(0)
        return (float(slopes[0]), float(slopes[1])) if len(slopes) else (0.0, 0.0)


def radial_law(scenario: Scenario) -> RadialLaw:
    """Returns the radial force of a scenario's law.

    Its tables cover distances up to the sensor range and speeds up to the top speed of
    the robot. Raises InputError if the law has no radial force.
    """
    key = scenario.model_copy(update={"name": "", "description": "", "seed": 0})
    sensor = key.follower.ultrasonic
    return _radial_law(
        key.only.law,
        str(loaded_digests(key)),
        f"{key.follower.laws.model_dump_json()} {key.only.own_gains}",
        (sensor.minimum_range_m, sensor.maximum_range_m),
        key.only.robot.top_speed_m_s,
        _Scenario(key),
    )


class _Scenario:
    """Passes a scenario to a cached function.

    All instances are equal, so that the scenario is not a part of the cache key.
    """

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
