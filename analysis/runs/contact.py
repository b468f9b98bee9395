"""Finds the point at which a robot touched another body."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from diagrams import RunResult
from diagrams.scenario.bodies import robot_rectangle
from systems.framework.input_error import InputError
from systems.world.geometry import (
    nearest_point_on_rectangle,
    rectangle_clearance,
    rectangle_corners,
)


def contact_point(result: RunResult) -> NDArray[np.float64]:
    """Returns the (2,) point in W at which the robot touched the other body, m.

    Raises InputError if the run had no collision.
    """
    hit, scenario = result.collision, result.scenario
    if hit is None:
        raise InputError("contact_point", f"the run ended by {result.cause!r}")
    body = result.surroundings.bodies[hit.object].rectangles(hit.time)
    pose = result.poses("WB")[np.argmin(np.abs(result.time - hit.time))]
    footprint = robot_rectangle(pose, scenario.only.robot)
    nearest = min(body, key=lambda row: rectangle_clearance(footprint, row))
    return touching_point(footprint, nearest)


def touching_point(
    a: NDArray[np.float64], b: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Returns the (2,) point at which two rectangles touch, m.

    Both rectangles are (x, y, theta, length, width, radius), m and rad, in the frame of
    the result. The first has no radius. The point is the mean of all corners of either
    rectangle that lie inside the other rectangle. If there is no such corner, the point
    is the mean of the corners that are nearest to the other rectangle. For a round
    corner, the point of the first rectangle that is nearest to its center counts.
    """
    own, other = rectangle_corners(a), rectangle_corners(b)
    into = [nearest_point_on_rectangle(corner, b) for corner in own]
    back = [nearest_point_on_rectangle(corner, a) for corner in other]
    away = np.array([math.hypot(*vector) for vector in [*into, *back]])
    away[4:] = np.maximum(away[4:] - b[5], 0.0)
    if b[5] > 0.0:
        other = other + np.array(back)
    points = np.concatenate([own, other])
    return np.mean(points[away <= away.min() + 1e-9], axis=0)
