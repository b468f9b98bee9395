"""What the robot's cones knew of a body that it then touched."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from diagrams.running.run_result import RunResult
from systems.framework.compiling import njit
from systems.world.geometry import fan_ranges

#: An echo is a body's if the range that was read is so near to that body's, m.
SAME_M = 0.03


def collision_warning(result: RunResult) -> dict[str, float | None]:
    """How a collision came about, as far as the sensors are concerned.

    Returns:
        ``contact_warning_s`` and ``contact_unseen_s``, from the first and from the
        last echo of the body to the contact, none: never heard of; and
        ``contact_push_n``, the law's push at the last tick, whatever it was that
        pushed, none of a law that does not say. All none without a collision; empty
        without cones.
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
    """(n,) whether any cone's echo was that body's, at the ticks."""
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
    """(n, cones) true ranges of (n, 5) rectangles, m; see ``fan_ranges``."""
    ranges = np.empty((len(poses), axes.size))
    for i in range(len(poses)):
        ranges[i] = fan_ranges(
            poses[i], bodies[i : i + 1], axes, places, half_angles, control_point_m
        )
    return ranges
