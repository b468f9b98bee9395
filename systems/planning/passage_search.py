"""Search for a passage on the route, and for the place from which to line up."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from systems.framework.compiling import njit
from systems.planning.passage import APPROACH, APPROACHING, OPEN, Passage, entrance
from systems.planning.passage_axis import NARROWEST, fit_axis
from systems.planning.way import Way, is_near
from systems.safety.free_space import (
    PARTS,
    FineSpace,
    FreeSpace,
    cell_is_free,
    cells_within,
)

#: Least number of hits of an occupied cell.
_HITS = 3.0
# ``_AHEAD_M``: a passage begins within this length of the route, m.
# ``_LONGEST``: longest part of a passage that counts, as a multiple of the disc's
#   radius.
# ``_GAP_M``: a passage ends where the route is not narrow for this length, m.
_AHEAD_M, _LONGEST, _GAP_M = 6.0, 4.0, 0.3
# A short part of the route has no direction.
# ``_SHORT``: number of its points.
# ``_FARTHER``: number of points before it and behind it that then count, too.
_SHORT, _FARTHER = 3, 5
# Searches for the axis of a new passage: first ``_TURN_RAD`` to both sides in steps of
# ``_STEP_RAD``, then ``_FINE_TURN_RAD`` in steps of ``_FINE_STEP_RAD``.
_TURN_RAD, _STEP_RAD, _FINE_TURN_RAD, _FINE_STEP_RAD = 0.8, 0.05, 0.06, 0.005
#: Directions from which the front may come to the axis, relative to the axis, rad.
_SLANTS = (0.0, 0.35, -0.35, 0.7, -0.7, 1.0, -1.0)
# ``_ENOUGH_M``: distance of the disc from the nearest wall that is enough, m.
# ``_BETTER_M``: distance by which a steeper direction has to be better, m.
_ENOUGH_M, _BETTER_M = 0.2, 0.01


@njit(cache=True)
def occupied_points(
    space: FreeSpace, place: Any, reach: float, clear: Any
) -> NDArray[np.float64]:  # pragma: no cover  (compiled)
    """Lists the middles of the occupied cells in a square.

    Within the window of the fine cells, the function lists those fine cells of occupied
    cells that were not seen free.

    Args:
        space: Map of free space with fine cells.
        place: Middle (x, y) of the square, m.
        reach: Half of its side, m.
        clear: (n, 3) positions (x, y) and radii, m, whose cells do not count.

    Returns:
        (n, 2) positions, m.
    """
    (x, y), fine, cells = place, space.fine, len(space.hits)
    found, count, small = np.empty((256, 2)), 0, fine.cell_m
    box = cells_within(space, x - reach, y - reach, x + reach, y + reach)
    for i in range(box[0], box[2] + 1):
        for j in range(box[1], box[3] + 1):
            if space.hits[i % cells, j % cells] < _HITS:
                continue
            px, py = (i + 0.5) * space.cell_m, (j + 0.5) * space.cell_m
            if is_near(clear, px, py):
                continue
            if count + PARTS * PARTS > len(found):
                more = np.empty((2 * len(found), 2))
                more[:count] = found[:count]
                found = more
            if not _in_window(fine, i, j):
                found[count, 0], found[count, 1] = px, py
                count += 1
                continue
            for a in range(i * PARTS, (i + 1) * PARTS):
                for b in range(j * PARTS, (j + 1) * PARTS):
                    if not cell_is_free(fine, a, b, space.rolled_m[0]):
                        found[count, 0], found[count, 1] = (
                            (a + 0.5) * small,
                            (b + 0.5) * small,
                        )
                        count += 1
    return found[:count]


@register_jitable
def _in_window(fine: FineSpace, i: int, j: int) -> bool:
    """Checks whether all fine cells of a cell are in their window."""
    size = len(fine.hits)
    a, b = i * PARTS - fine.first[0], j * PARTS - fine.first[1]
    return 0 <= a <= size - PARTS and 0 <= b <= size - PARTS


@njit(cache=True)
def sides(
    points: Any, x: float, y: float, opposite: float = -0.5
) -> tuple[float, float]:  # pragma: no cover  (compiled)
    """Computes the distances of the nearest point and of the nearest one opposite, m.

    Args:
        points: (n, 2) positions of occupied cells, m.
        x: Position from which the distances count, x, m.
        y: Position, y, m.
        opposite: Cosine of the least angle between the directions of both points.

    Returns:
        Two distances, m, infinite without such a point.
    """
    first, at = np.inf, -1
    for k in range(len(points)):
        distance = math.hypot(points[k, 0] - x, points[k, 1] - y)
        if distance < first:
            first, at = distance, k
    second = np.inf
    if at >= 0:
        ux, uy = points[at, 0] - x, points[at, 1] - y
        for k in range(len(points)):
            dx, dy = points[k, 0] - x, points[k, 1] - y
            distance = math.hypot(dx, dy)
            if distance < second and ux * dx + uy * dy < opposite * first * distance:
                second = distance
    return first, second


@njit(cache=True)
def _narrow_part(
    way: Way, points: Any, radius: float, widest: float
) -> tuple[int, int]:  # pragma: no cover  (compiled)
    """Finds the first narrow part of the route, with points on both sides.

    Returns:
        Numbers of its first and last point, or -1 and -1.
    """
    begin, end, length = -1, -1, 0.0
    for k in range(1, way.points[0]):
        x, y = way.path[k]
        step = math.hypot(x - way.path[k - 1, 0], y - way.path[k - 1, 1])
        length += step
        first, second = sides(points, x, y)
        if first + second < widest:
            if begin < 0:
                if length > _AHEAD_M:
                    break
                begin, length = k, 0.0
            end = k
            if length > _LONGEST * radius:
                break
        elif (begin >= 0 and length > _GAP_M) or (begin < 0 and length > _AHEAD_M):
            break
    return begin, end


@njit(cache=True)
def find_passage(
    p: Passage,
    way: Way,
    points: Any,
    radius: float,
    half_size: Any,
    widest: float,
) -> None:  # pragma: no cover  (compiled)
    """Finds the first passage of the route, and where to line up for it.

    Args:
        p: Passage. The function changes the arrays in place.
        way: Route from the robot to the goal.
        points: (n, 2) positions of occupied cells, m.
        radius: Radius of the disc around the body, with margin, m.
        half_size: Half of the body's length and width, m.
        widest: Width from which on the robot does not line up, m.
    """
    p.state[0] = OPEN
    begin, end = _narrow_part(way, points, radius, widest)
    if begin < 0:
        return
    a, b, m = way.path[begin], way.path[end], way.path[(begin + end) // 2]
    if end - begin < _SHORT:
        a, b = (
            way.path[max(begin - _FARTHER, 0)],
            way.path[min(end + _FARTHER, way.points[0] - 1)],
        )
    p.middle[0], p.middle[1] = m[0], m[1]
    length = math.hypot(b[0] - a[0], b[1] - a[1])
    p.axis[0] = math.atan2(b[1] - a[1], b[0] - a[0])
    p.half_m[0] = max(0.5 * length, radius)
    for _ in range(2):
        fit_axis(p, points, _TURN_RAD, _STEP_RAD)
    fit_axis(p, points, _FINE_TURN_RAD, _FINE_STEP_RAD)
    if p.width_m[0] < NARROWEST * half_size[1] or p.width_m[0] >= widest:
        return
    p.state[0], p.failures[0] = APPROACHING, 0.0
    place_approach(p, points, radius, half_size[0])


@njit(cache=True)
def place_approach(
    p: Passage, points: Any, radius: float, half_length: float
) -> None:  # pragma: no cover  (compiled)
    """Places the axle so that its front is on the axis and the disc is clear."""
    best = -np.inf
    back = APPROACH * half_length - entrance(p, half_length)
    c, s = math.cos(p.axis[0]), math.sin(p.axis[0])
    fx, fy = p.middle[0] - back * c, p.middle[1] - back * s
    for slant in _SLANTS:
        angle = p.axis[0] + slant
        x, y = fx - half_length * math.cos(angle), fy - half_length * math.sin(angle)
        clear = min(sides(points, x, y)[0], radius + _ENOUGH_M)
        if clear > best + _BETTER_M:
            best, p.approach[0], p.approach[1] = clear, x, y
