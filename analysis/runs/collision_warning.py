"""Computes how early the range sensors saw a body that the robot then touched."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from diagrams.running.run_result import RunResult
from systems.framework.compiling import njit
from systems.world.geometry import fan_ranges

#: An echo belongs to a body if the range reading differs from the true range of this
#: body by at most this distance, m.
SAME_M = 0.03


def collision_warning(result: RunResult) -> dict[str, float | None]:
    """Computes how early the range sensors saw the body that the robot touched.

    The result has these entries:

    - ``contact_warning_s``: time from the first echo of the body to the contact, s. The
      value is None if the body never caused an echo.
    - ``contact_unseen_s``: time from the last echo of the body to the contact, s. The
      value is None if the body never caused an echo.
    - ``contact_push_n``: magnitude of the repulsive force of the control law at the
      last tick (control period), N. The force can come from any obstacle. The value is
      None if the law does not log its forces.

    Args:
        result: Result of a run, for one robot.

    Returns:
        Value of each entry, by name. If the run had no collision, all values are None.
        If the robot has no range sensors, the dictionary is empty.
    """
    hit, columns = result.collision, result.columns
    if "range_1" not in columns:
        return {}
    warning = unseen = push = None
    if hit is not None:
        known = result.time[_echoes(result, hit.object)]
        if len(known):
            warning, unseen = np.maximum(hit.time - known[[0, -1]], 0.0).tolist()
        if "repulsion_x" in columns:
            push = math.hypot(*result.vector("repulsion")[:, -1])
    return {
        "contact_warning_s": warning,
        "contact_unseen_s": unseen,
        "contact_push_n": push,
    }


def _echoes(result: RunResult, name: str) -> NDArray[np.bool_]:
    """(n,) whether any sensor had an echo of the named body, at each tick."""
    scenario, columns = result.scenario, result.columns
    sensors, control_point_m = (
        scenario.sensing.ultrasonic,
        scenario.only.robot.control_point_m,
    )
    bodies = result.surroundings.bodies[name].rectangles(result.time)
    ranges = _cone_ranges(result.poses("WB"), bodies, *sensors.beams, control_point_m)
    numbers = range(1, sensors.count + 1)
    read = np.stack([columns[f"range_{k}"] for k in numbers], axis=1)
    echo = np.stack([columns[f"echo_{k}"] for k in numbers], axis=1) > 0.5
    return np.any(echo & (np.abs(read - ranges) <= SAME_M), axis=1)


@njit(cache=True)
def _cone_ranges(
    poses: NDArray[np.float64],
    bodies: NDArray[np.float64],
    axes: NDArray[np.float64],
    places: NDArray[np.float64],
    half_angles: NDArray[np.float64],
    control_point_m: float,
) -> NDArray[np.float64]:  # pragma: no cover  (compiled)
    """(n, sensors) true ranges of one moving rectangle, m; see ``fan_ranges``."""
    ranges = np.empty((len(poses), axes.size))
    for i in range(len(poses)):
        ranges[i] = fan_ranges(
            poses[i], bodies[i : i + 1], axes, places, half_angles, control_point_m
        )
    return ranges
