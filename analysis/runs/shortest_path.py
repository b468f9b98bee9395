"""Computes the shortest path of a disc around boxes, to compare driven paths."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from systems.framework.compiling import njit
from systems.world.geometry import beyond_rectangle, segment_clearance

Floats = NDArray[np.float64]

#: Number of tangents that replace a quarter circle around a corner. Together, they are
#: 0.6 % longer than the quarter circle.
TANGENTS = 6
#: Depth to which a path may cut into a grown box, m. A path lies on the outline of the
#: box, so rounding errors can put it slightly inside.
GRAZE_M = 1e-6


def shortest_path_length(
    start: ArrayLike,
    goal: ArrayLike,
    goal_radius: float,
    boxes: ArrayLike,
    radius: float,
) -> float:
    """Computes the length of the shortest path of a disc to a circle around the goal.

    Lengths are in m. The boxes (n, 6) are rectangles (x, y, theta, length, width,
    radius) at rest, m and rad. The path is that of the center of the disc, and ends on
    the circle.

    The function grows the boxes by the radius of the disc. Polygons just outside of the
    grown boxes replace their rounded corners. The function then runs A* on the
    visibility graph of the corners of these polygons. The last leg of a path runs
    straight toward the goal.

    If the disc overlaps a box at the start, this box grows only up to the center of the
    disc. The length is 0 if the start is inside the circle, and infinite if there is no
    path.
    """
    ends = np.asarray([start, goal], dtype=float)
    rectangles = np.asarray(boxes, dtype=float).reshape(-1, 6)
    return _search(ends[0], ends[1], float(goal_radius), rectangles, float(radius))


@njit(cache=True)
def _search(
    start: Floats, goal: Floats, goal_radius: float, boxes: Floats, radius: float
) -> float:  # pragma: no cover  (compiled)
    """Runs A* from the start. The heuristic is the straight distance to the circle."""
    radii = np.array([min(radius, _beyond(start, box)) for box in boxes])
    circles = np.empty((len(boxes), 3))
    for k, box in enumerate(boxes):
        circles[k] = _circle(box, radii[k])
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
    # A leg to a point in another grown box is never free. ``cut_by`` is the box that
    # cut the last leg to a point: it often cuts the next one, too.
    cut_by = np.zeros(len(points), dtype=np.int64)
    done = np.array(
        [_cutting(point, point, boxes, radii, circles, 0) >= 0 for point in points]
    )
    done[0] = False
    best = np.inf
    while True:
        here, bound = 0, best
        for k in range(len(points)):
            if not done[k] and lengths[k] + to_goal[k] < bound:
                here, bound = k, lengths[k] + to_goal[k]
        if bound >= best:
            return best
        done[here] = True
        # For a point inside the goal circle, the last leg has the length 0.
        share = to_goal[here] / max(_distance(points[here], goal), 1e-12)
        last = points[here] + share * (goal - points[here])
        if _cutting(points[here], last, boxes, radii, circles, 0) < 0:
            best = min(best, bound)
        for k in range(len(points)):
            reach = lengths[here] + _distance(points[here], points[k])
            if done[k] or reach >= lengths[k] or reach + to_goal[k] >= best:
                continue
            box = _cutting(points[here], points[k], boxes, radii, circles, cut_by[k])
            if box < 0:
                lengths[k] = reach
            else:
                cut_by[k] = box


@njit(cache=True)
def _distance(a: Floats, b: Floats) -> float:  # pragma: no cover  (compiled)
    return math.hypot(b[0] - a[0], b[1] - a[1])


@njit(cache=True)
def _beyond(point: Floats, box: Floats) -> float:  # pragma: no cover  (compiled)
    """Returns the distance of a point from a box, m."""
    du, dv = beyond_rectangle(point, box)
    return math.hypot(du, dv)


@njit(cache=True)
def _outline(
    box: Floats, radius: float, corners: Floats
) -> None:  # pragma: no cover  (compiled)
    """Computes the corners of a polygon just outside of a box that grew by a radius."""
    step = 0.5 * math.pi / TANGENTS
    arc = (radius + box[5]) / math.cos(0.5 * step)
    c, s = math.cos(box[2]), math.sin(box[2])
    for k in range(4 * TANGENTS):
        angle = (k + 0.5) * step
        x = math.copysign(box[3] / 2.0, math.cos(angle)) + arc * math.cos(angle)
        y = math.copysign(box[4] / 2.0, math.sin(angle)) + arc * math.sin(angle)
        corners[k, 0] = box[0] + c * x - s * y
        corners[k, 1] = box[1] + s * x + c * y


@njit(cache=True)
def _circle(
    box: Floats, radius: float
) -> tuple[float, float, float]:  # pragma: no cover  (compiled)
    """Returns the middle and the radius of a circle around a grown box, m."""
    return box[0], box[1], 0.5 * math.hypot(box[3], box[4]) + box[5] + radius


@njit(cache=True)
def _cutting(
    start: Floats,
    end: Floats,
    boxes: Floats,
    radii: Floats,
    circles: Floats,
    first: int,
) -> int:  # pragma: no cover  (compiled)
    """Finds a box nearer to a straight leg than its distance in ``radii``.

    The boxes are tried in order, but ``first`` is tried first. The result is the index
    of the box, or -1.
    """
    ahead_x, ahead_y = end[0] - start[0], end[1] - start[1]
    squared = max(ahead_x * ahead_x + ahead_y * ahead_y, 1e-18)
    for n in range(-1, len(boxes)):
        k = n if n >= 0 else first
        if k >= len(boxes):
            continue
        x, y = circles[k, 0] - start[0], circles[k, 1] - start[1]
        share = min(max((x * ahead_x + y * ahead_y) / squared, 0.0), 1.0)
        x, y = x - share * ahead_x, y - share * ahead_y
        if x * x + y * y > circles[k, 2] * circles[k, 2]:
            continue
        if segment_clearance(start, end, boxes[k]) < radii[k] - GRAZE_M:
            return k
    return -1
