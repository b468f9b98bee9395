"""Computes how early the range sensors saw a body that the robot then touched."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from diagrams.running.run_result import RunResult
from systems.framework.compiling import njit
from systems.world.geometry import fan_ranges

#: An echo belongs to a body if the range reading differs from the true range of this
#: body by at most this distance, m.
SAME_M = 0.03


def echo_times(result: RunResult) -> tuple[float | None, float | None]:
    """Computes when the range sensors saw the body that the robot touched.

    Args:
        result: Result of a run, for one robot with range sensors.

    Returns:
        Two times, s: from the first and from the last echo of the body to the contact.
        Both are None if the run had no collision, or the body never caused an echo.
    """
    hit = result.collision
    if hit is None:
        return None, None
    known = result.time[_echoes(result, hit.object)]
    if not len(known):
        return None, None
    first, last = np.maximum(hit.time - known[[0, -1]], 0.0).tolist()
    return first, last


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
