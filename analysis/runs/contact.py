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
from systems.world.shapes import Shape

Floats = NDArray[np.float64]


def contact_point(result: RunResult) -> NDArray[np.float64]:
    """Returns the (2,) point in W at which the robot touched the other body, m.

    Raises InputError if the run had no collision.
    """
    footprint, rows, nearest = _touching(result)
    return touching_point(footprint, rows[nearest])


def touched_shape(result: RunResult) -> Shape:
    """Returns the part of a body that a robot touched, in the axes of the body.

    It is one rectangle of a wall or a map, and the whole of any other body. Raises
    InputError if the run had no collision.
    """
    *_, nearest = _touching(result)
    assert result.collision is not None
    shape = result.surroundings.bodies[result.collision.object].shape
    if shape.polygon is not None:
        return shape
    return Shape(shape.rectangles[nearest : nearest + 1].copy())


def _touching(result: RunResult) -> tuple[Floats, Floats, int]:
    """Returns the robot's rectangle, those of the body, and the index of the nearest.

    The rectangles are those at the time of the collision, in W.
    """
    hit = result.collision
    if hit is None:
        raise InputError("contact_point", f"the run ended by {result.cause!r}")
    rows = result.surroundings.bodies[hit.object].rectangles(hit.time)
    pose = result.poses("WB")[np.argmin(np.abs(result.time - hit.time))]
    footprint = robot_rectangle(pose, result.scenario.only.robot)
    clearances = [rectangle_clearance(footprint, row) for row in rows]
    return footprint, rows, int(np.argmin(clearances))


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
