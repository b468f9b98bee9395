"""What the robot's cones knew of a body that it then touched."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from diagrams.simulation import RunResult
from systems.ranging.ultrasonic_array import cone_ranges

__all__ = ["CollisionWarning", "collision_warning"]

#: An echo is a body's if the range that was read is so near to that body's, m.
SAME_M = 0.03


@dataclass(frozen=True)
class CollisionWarning:
    """How a collision came about, as far as the sensors are concerned."""

    warning_s: float | None
    """From the first echo of the body to the contact, s; none: never heard of."""
    unseen_s: float | None
    """From its last echo to the contact, s."""
    push_n: float | None
    """Push of the law at the last tick, N, whatever it was that pushed; none of a
    law that does not say."""


def collision_warning(result: RunResult) -> CollisionWarning | None:
    """Echoes of the body that was hit; none without a collision or cones."""
    hit, columns = result.collision, result.columns
    if hit is None or "range_1" not in columns:
        return None
    known = np.flatnonzero(_echoes(result, hit.object))
    first = result.time[known[0]] if len(known) else None
    last = result.time[known[-1]] if len(known) else None
    push = None
    if "repulsion_x" in columns:
        push = math.hypot(columns["repulsion_x"][-1], columns["repulsion_y"][-1])
    return CollisionWarning(
        warning_s=None if first is None else float(max(hit.time - first, 0.0)),
        unseen_s=None if last is None else float(max(hit.time - last, 0.0)),
        push_n=push,
    )


def _echoes(result: RunResult, name: str) -> NDArray[np.bool_]:
    """(n,) whether any cone's echo was that body's, at the ticks."""
    scenario, columns = result.scenario, result.columns
    sensors, control_point_m = scenario.ultrasonic, scenario.robot.control_point_m
    bodies = result.surroundings.bodies[name].rectangles(result.time)
    ranges = [
        cone_ranges(pose, body[np.newaxis], sensors, control_point_m)
        for pose, body in zip(result.poses("WB"), bodies, strict=True)
    ]
    numbers = range(1, sensors.count + 1)
    read = np.stack([columns[f"range_{k}"] for k in numbers], axis=1)
    echo = np.stack([columns[f"echo_{k}"] for k in numbers], axis=1) > 0.5
    return np.any(echo & (np.abs(read - ranges) <= SAME_M), axis=1)
