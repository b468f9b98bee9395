"""Passages that are narrower than the disc around a long body.

A long body can pass them only in line with them. For a passage on the route, this
module finds its axis, and a place at which the robot begins to line up with it.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from systems.framework.compiling import njit
from systems.planning.turning import wrapped
from systems.planning.way import Way, is_near
from systems.safety.free_space import (
    PARTS,
    FineSpace,
    FreeSpace,
    cell_is_free,
    cells_within,
)

#: States of ``Passage``: there is no passage, the robot drives to its approach, it
#: drives along the axis, it backs out because the guard has stopped it there, or it turns
#: away from a wall behind the passage.
OPEN, APPROACHING, PASSING, RETREATING, LEAVING = range(5)

#: A passage begins within this length of the route, m.
_AHEAD_M = 6.0
#: Longest part of a passage that counts at once, as a multiple of the disc's radius.
_LONGEST = 4.0
#: Least number of hits of an occupied cell.
_HITS = 3.0
# ``_LINED_UP_RAD``: largest heading error at the begin of the passage, rad.
# ``_LINED_UP``: largest distance from the axis there, as a multiple of the half width.
_LINED_UP_RAD, _LINED_UP = 0.015, 0.03
#: Distance from the approach to the passage, as a multiple of half of the length.
_APPROACH = 3.8
#: Directions from which the front may come to the approach, from the axis, rad.
_SLANTS = (0.0, 0.35, -0.35, 0.7, -0.7, 1.0, -1.0)
#: Steps of the search for the axis: coarse and fine, rad.
_STEPS = 0.05, 0.005
# ``_PIECE_M``: length of a piece of a wall, m.
# ``_FEW``: share of the pieces that may be nearer than the wall.
# ``_NO_WALL_M``: distance of a wall that is not there, m.
_PIECE_M, _FEW, _NO_WALL_M = 0.05, 0.25, 3.0
#: Weight of the mean deviation of the walls from a straight line against the width.
_STRAIGHT = 20.0
#: Least share of the difference by which a map moves the axis.
_LEAST_GAIN = 0.2
# ``_CENTER_GAIN``: share of the difference by which a plan moves the axis in a passage.
# ``_BESIDE_M``: distance from the body within which there is a passage, m.
_CENTER_GAIN, _BESIDE_M = 0.3, 0.15
#: Least measured width of a passage, as a multiple of half of the body's width.
_NARROWEST = 1.6
#: Distance within which the front returns to the axis, as a multiple of half of the
#: length.
_RETURN = 0.5


class Passage(NamedTuple):
    """The passage for which the robot lines up. Arrays have the shape (1,)."""

    state: NDArray[np.float64]
    """``OPEN``, ``APPROACHING`` or ``PASSING``."""
    middle: NDArray[np.float64]
    """(2,) point (x, y) on the axis, in the middle of the passage, m."""
    axis: NDArray[np.float64]
    """Direction of the axis, rad."""
    half_m: NDArray[np.float64]
    """Half of the length of the passage, m."""
    width_m: NDArray[np.float64]
    """Width of the passage, m."""
    approach: NDArray[np.float64]
    """(2,) point (x, y) from which the axle starts along the axis, m."""
    backed_from: NDArray[np.float64]
    """Position of the front along the axis at which the robot began to back out, m."""
    failures: NDArray[np.float64]
    """Number of times that the guard has stopped the robot in this passage."""
    maps: NDArray[np.float64]
    """Number of maps of which the axis is the mean."""


def make_passage() -> Passage:
    """Makes the memory without a passage."""
    return Passage(*(np.zeros(n) for n in (1, 2, 1, 1, 1, 2, 1, 1, 1)))


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
                        found[count, 0], found[count, 1] = (a + 0.5) * small, (b + 0.5) * small
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
    way: Way, points: Any, radius: float
) -> tuple[int, int]:  # pragma: no cover  (compiled)
    """Finds the first part of the route with points on both sides within the disc.

    Returns:
        Numbers of its first and last point, or -1 and -1.
    """
    begin, end, length = -1, -1, 0.0
    for k in range(1, way.points[0]):
        x, y = way.path[k]
        step = math.hypot(x - way.path[k - 1, 0], y - way.path[k - 1, 1])
        length += step
        first, second = sides(points, x, y)
        if first + second < 2.0 * radius:
            if begin < 0:
                if length > _AHEAD_M:
                    break
                begin, length = k, 0.0
            end = k
            if length > _LONGEST * radius:
                break
        elif begin >= 0 and length > 0.3:
            break
        elif begin < 0 and length > _AHEAD_M:
            break
    return begin, end


@njit(cache=True)
def _walls(
    points: Any, middle: Any, angle: float, half: float
) -> tuple[float, float, float]:  # pragma: no cover  (compiled)
    """Measures the walls beside a line.

    The part of the line within ``half`` of the middle is divided into pieces. On each
    side, the wall is at a distance that few pieces fall below, because echoes of a wide
    beam may seem to come from points in front of the wall.

    Returns:
        Distances of the right and of the left wall, and mean absolute deviation of the
        pieces from these distances, m.
    """
    c, s = math.cos(angle), math.sin(angle)
    pieces = max(1, math.ceil(2.0 * half / _PIECE_M))
    nearest = np.full((2, pieces), np.inf)
    for k in range(len(points)):
        dx, dy = points[k, 0] - middle[0], points[k, 1] - middle[1]
        piece = math.floor((c * dx + s * dy + half) / (2.0 * half) * pieces)
        if 0 <= piece < pieces:
            v = c * dy - s * dx
            side = 1 if v > 0.0 else 0
            nearest[side, piece] = min(nearest[side, piece], abs(v))
    walls, deviation, count = np.full(2, _NO_WALL_M), 0.0, 0
    for side in range(2):
        ordered = np.sort(nearest[side])
        known = int(np.searchsorted(ordered, _NO_WALL_M))
        if known > 0:
            walls[side] = ordered[int(_FEW * known)]
            middle_one = ordered[known // 2]
            for k in range(known):
                deviation += min(abs(ordered[k] - middle_one), 0.1)
            count += known
    return walls[0], walls[1], deviation / max(count, 1)


@njit(cache=True)
def fit_axis(
    p: Passage, points: Any, spread: float, step: float
) -> None:  # pragma: no cover  (compiled)
    """Turns and shifts the axis so that the passage is wide and its walls straight.

    The directions differ from the present one by at most ``spread``, rad, in steps of
    ``step``.
    """
    begin, best, found = p.axis[0], -np.inf, 0.0
    steps = math.ceil(spread / step)
    for n in range(-steps, steps + 1):
        right, left, deviation = _walls(
            points, p.middle, begin + n * step, p.half_m[0]
        )
        score = right + left - _STRAIGHT * deviation
        if score > best:
            best, found = score, n * step
    p.axis[0] = angle = begin + found
    right, left, _ = _walls(points, p.middle, angle, p.half_m[0])
    shift = 0.5 * (left - right)
    p.middle[0] -= shift * math.sin(angle)
    p.middle[1] += shift * math.cos(angle)
    p.width_m[0] = right + left


@njit(cache=True)
def refine_axis(
    p: Passage, points: Any, most_m: float, half_width: float
) -> None:  # pragma: no cover  (compiled)
    """Moves the axis toward that of the present map, at first to the mean of all maps.

    A map whose axis is farther beside than ``most_m``, m, does not count.
    """
    x, y, axis, width = p.middle[0], p.middle[1], p.axis[0], p.width_m[0]
    fit_axis(p, points, 0.06, _STEPS[1])
    moved, share = math.hypot(p.middle[0] - x, p.middle[1] - y), 0.0
    if moved <= most_m and p.width_m[0] >= _NARROWEST * half_width:
        p.maps[0] += 1.0
        share = max(1.0 / p.maps[0], _LEAST_GAIN)
    p.middle[0], p.middle[1] = x + share * (p.middle[0] - x), y + share * (p.middle[1] - y)
    p.axis[0] = axis + share * (p.axis[0] - axis)
    p.width_m[0] = width + share * (p.width_m[0] - width)


@njit(cache=True)
def center_axis(
    p: Passage, space: FreeSpace, pose: Any, radius: float, half_width: float
) -> None:  # pragma: no cover  (compiled)
    """Moves the axis toward the middle of the free space beside the body.

    The front half and the rear half of the disc count separately, and only if there is
    non-free space on both sides of the body.

    Args:
        p: Passage. The function changes the arrays in place.
        space: Map of free space with fine cells.
        pose: Pose (x, y, theta) of the body, m and rad.
        radius: Radius of the disc around the body, m.
        half_width: Half of the width of the body, m.
    """
    fine, c, s = space.fine, math.cos(p.axis[0]), math.sin(p.axis[0])
    x, y, cell, widest = pose[0], pose[1], space.fine.cell_m, half_width + _BESIDE_M
    walls = np.full((2, 2), np.inf)
    box = cells_within(fine, x - radius, y - radius, x + radius, y + radius)
    for i in range(box[0], box[2] + 1):
        for j in range(box[1], box[3] + 1):
            if cell_is_free(fine, i, j, space.rolled_m[0]):
                continue
            if cell_is_free(space, i // PARTS, j // PARTS, space.rolled_m[0]):
                continue
            dx, dy = (i + 0.5) * cell, (j + 0.5) * cell
            u, v = c * (dx - x) + s * (dy - y), 0.0
            v = c * (dy - p.middle[1]) - s * (dx - p.middle[0])
            if abs(u) < radius:
                half, side = (1 if u > 0.0 else 0), (1 if v > 0.0 else 0)
                walls[half, side] = min(walls[half, side], abs(v))
    shifts, count = np.zeros(2), 0
    for half in range(2):
        if walls[half, 0] < widest and walls[half, 1] < widest:
            shifts[half] = 0.5 * (walls[half, 1] - walls[half, 0])
            count += 1
    if count == 0:
        return
    shift = _CENTER_GAIN * (shifts[0] + shifts[1]) / count
    p.middle[0], p.middle[1] = p.middle[0] - shift * s, p.middle[1] + shift * c
    if count == 2:
        # The line turns about the middle of the body.
        turn = _CENTER_GAIN * (shifts[1] - shifts[0]) / radius
        dx, dy = p.middle[0] - x, p.middle[1] - y
        p.middle[0], p.middle[1] = x + dx - turn * dy, y + dy + turn * dx
        p.axis[0] += turn


@njit(cache=True)
def find_passage(
    p: Passage, way: Way, points: Any, radius: float, half_size: Any
) -> None:  # pragma: no cover  (compiled)
    """Finds the first passage of the route, and where to line up for it.

    Args:
        p: Passage. The function changes the arrays in place.
        way: Route from the robot to the goal.
        points: (n, 2) positions of occupied cells, m.
        radius: Radius of the disc around the body, with margin, m.
        half_size: Half of the body's length and width, m.
    """
    p.state[0] = OPEN
    begin, end = _narrow_part(way, points, radius)
    if begin < 0:
        return
    a, b, m = way.path[begin], way.path[end], way.path[(begin + end) // 2]
    if end - begin < 3:
        a, b = way.path[max(begin - 5, 0)], way.path[min(end + 5, way.points[0] - 1)]
    p.middle[0], p.middle[1] = m[0], m[1]
    length = math.hypot(b[0] - a[0], b[1] - a[1])
    p.axis[0] = math.atan2(b[1] - a[1], b[0] - a[0])
    p.half_m[0] = max(0.5 * length, radius)
    for _ in range(2):
        fit_axis(p, points, 0.8, _STEPS[0])
    fit_axis(p, points, 0.06, _STEPS[1])
    if p.width_m[0] < _NARROWEST * half_size[1] or p.width_m[0] >= 2.0 * radius:
        return
    p.state[0], p.failures[0] = APPROACHING, 0.0
    place_approach(p, points, radius, half_size[0])


@njit(cache=True)
def place_approach(
    p: Passage, points: Any, radius: float, half_length: float
) -> None:  # pragma: no cover  (compiled)
    """Places the axle so that its front is on the axis and the disc is clear."""
    best = -np.inf
    back = p.half_m[0] + _APPROACH * half_length
    c, s = math.cos(p.axis[0]), math.sin(p.axis[0])
    fx, fy = p.middle[0] - back * c, p.middle[1] - back * s
    for slant in _SLANTS:
        angle = p.axis[0] + slant
        x, y = fx - half_length * math.cos(angle), fy - half_length * math.sin(angle)
        clear = min(sides(points, x, y)[0], radius + 0.2)
        if clear > best + 0.01:
            best, p.approach[0], p.approach[1] = clear, x, y


@register_jitable
def front_error(p: Passage, pose: Any, half_length: float) -> tuple[float, float]:
    """Computes where the middle of the front is, along and beside the axis, m."""
    c, s = math.cos(p.axis[0]), math.sin(p.axis[0])
    dx = pose[0] + half_length * math.cos(pose[2]) - p.middle[0]
    dy = pose[1] + half_length * math.sin(pose[2]) - p.middle[1]
    return c * dx + s * dy, c * dy - s * dx


@register_jitable
def along_axis(p: Passage, pose: Any, half_length: float) -> float:
    """Computes the direction in which the front has to move, from the heading, rad."""
    _, aside = front_error(p, pose, half_length)
    wanted = p.axis[0] - math.atan(aside / (_RETURN * half_length))
    return wrapped(wanted - pose[2])


@njit(cache=True)
def lines_up(
    p: Passage, pose: Any, half_size: Any
) -> bool:  # pragma: no cover  (compiled)
    """Predicts whether the robot is in line when its front enters the passage."""
    half_length, step = half_size[0], 0.02
    x, y, theta = pose[0], pose[1], pose[2]
    along, aside = front_error(p, pose, half_length)
    if along < -p.half_m[0] - (_APPROACH + 1.5) * half_length:
        return False
    for _ in range(1000):
        now = x, y, theta
        along, aside = front_error(p, now, half_length)
        error = along_axis(p, now, half_length)
        if along >= -p.half_m[0]:
            off = abs(wrapped(p.axis[0] - theta))
            return off < _LINED_UP_RAD and abs(aside) < _LINED_UP * half_size[1]
        if abs(error) > 1.2:
            return False
        way = step * math.cos(error)
        x, y = x + way * math.cos(theta), y + way * math.sin(theta)
        theta += step * math.sin(error) / half_length
    return False
