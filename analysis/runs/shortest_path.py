"""The shortest way of a disc round boxes: what a path length is compared with."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from systems.framework.compiling import njit
from systems.world.geometry import beyond_rectangle, segment_clearance

#: Tangents that a quarter circle round a corner is made of: 0.6 % too long.
TANGENTS = 6
#: A way may cut this deep into a rounded box, m: it lies on its outline.
GRAZE_M = 1e-6


def shortest_path_length(
    start: ArrayLike,
    goal: ArrayLike,
    goal_radius: float,
    boxes: ArrayLike,
    radius: float,
) -> float:
    """Length of the shortest way of a disc's centre into a circle round the goal.

    A* over the visibility graph of the boxes, grown by the disc's radius: legs
    run between points of their outlines, the last one straight at the goal.
    The rounded corners are polygons outside the arcs. A box nearer to the start
    than the radius is grown as far as the start allows.

    Args:
        start: (2,) m.
        goal: (2,) m.
        goal_radius: The way ends at this distance from the goal, m.
        boxes: (n, 5) rectangles at rest, see ``systems.world.geometry``.
        radius: Of the disc, m.

    Returns:
        m; 0 from within the circle, infinite where there is no way.
    """
    ends = np.asarray([start, goal], dtype=float)
    rectangles = np.asarray(boxes, dtype=float).reshape(-1, 5)
    return _search(ends[0], ends[1], float(goal_radius), rectangles, float(radius))


@njit(cache=True)
def _search(
    start: NDArray[np.float64],
    goal: NDArray[np.float64],
    goal_radius: float,
    boxes: NDArray[np.float64],
    radius: float,
) -> float:  # pragma: no cover  (compiled)
    """A* from the start; the straight distance to the goal is its bound."""
    radii = np.array([min(radius, _beyond(start, box)) for box in boxes])
    points = np.empty((1 + 4 * TANGENTS * len(boxes), 2))
    points[0] = start
    for k, box in enumerate(boxes):
        begin = 1 + 4 * TANGENTS * k
        _outline(box, radii[k], points[begin : begin + 4 * TANGENTS])
    to_goal = np.empty(len(points))
    for k, point in enumerate(points):
        away = _distance(point, goal)
        to_goal[k] = max(away - goal_radius, 0.0)
    lengths = np.full(len(points), np.inf)
    lengths[0] = 0.0
    done = np.zeros(len(points), dtype=np.bool_)
    best = np.inf
    while True:
        here, bound = 0, best
        for k in range(len(points)):
            if not done[k] and lengths[k] + to_goal[k] < bound:
                here, bound = k, lengths[k] + to_goal[k]
        if bound >= best:
            return best
        done[here] = True
        # A goal's disc may hold points; from there the last leg has no length.
        share = to_goal[here] / max(_distance(points[here], goal), 1e-12)
        last = points[here] + share * (goal - points[here])
        if _free(points[here], last, boxes, radii):
            best = min(best, bound)
        for k in range(len(points)):
            reach = lengths[here] + _distance(points[here], points[k])
            useful = reach < lengths[k] and reach + to_goal[k] < best
            if useful and not done[k] and _free(points[here], points[k], boxes, radii):
                lengths[k] = reach


@njit(cache=True)
def _distance(
    a: NDArray[np.float64], b: NDArray[np.float64]
) -> float:  # pragma: no cover  (compiled)
    return math.hypot(b[0] - a[0], b[1] - a[1])


@njit(cache=True)
def _beyond(
    point: NDArray[np.float64], box: NDArray[np.float64]
) -> float:  # pragma: no cover  (compiled)
    """Distance of a point from a box, m."""
    du, dv = beyond_rectangle(point, box)
    return math.hypot(du, dv)


@njit(cache=True)
def _outline(
    box: NDArray[np.float64], radius: float, corners: NDArray[np.float64]
) -> None:  # pragma: no cover  (compiled)
    """Sets the corners of a polygon just outside the box grown by the radius."""
    step = 0.5 * math.pi / TANGENTS
    arc = radius / math.cos(0.5 * step)
    c, s = math.cos(box[2]), math.sin(box[2])
    for k in range(4 * TANGENTS):
        angle = (k + 0.5) * step
        x = math.copysign(box[3] / 2.0, math.cos(angle)) + arc * math.cos(angle)
        y = math.copysign(box[4] / 2.0, math.sin(angle)) + arc * math.sin(angle)
        corners[k, 0] = box[0] + c * x - s * y
        corners[k, 1] = box[1] + s * x + c * y


@njit(cache=True)
def _free(
    start: NDArray[np.float64],
    end: NDArray[np.float64],
    boxes: NDArray[np.float64],
    radii: NDArray[np.float64],
) -> bool:  # pragma: no cover  (compiled)
    """Whether a leg keeps its distances from all boxes."""
    for k in range(len(boxes)):
        if segment_clearance(start, end, boxes[k]) < radii[k] - GRAZE_M:
            return False
    return True
