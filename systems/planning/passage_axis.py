"""Fit of the axis of a passage to the map."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from systems.framework.compiling import njit
from systems.planning.passage import Passage
from systems.safety.free_space import PARTS, FreeSpace, cell_is_free, cells_within

# ``_PIECE_M``: length of a piece of a wall, m.
# ``_FEW``: share of the pieces that may be nearer than the wall.
# ``_NO_WALL_M``: distance of a wall that is not there, m.
_PIECE_M, _FEW, _NO_WALL_M = 0.05, 0.25, 3.0
# ``_STRAIGHT``: weight of the walls' mean deviation from straight lines in the score of
#   a direction. The weight of the width is 1.
# ``_MOST_DEVIATION_M``: larger deviations count as this one, m.
_STRAIGHT, _MOST_DEVIATION_M = 20.0, 0.1
# ``_TURN_RAD``, ``_STEP_RAD``: largest turn of the axis by one map, and step of the
#   search, rad.
# ``_LEAST_GAIN``: least share of the difference by which a map moves the axis.
# ``NARROWEST``: least measured width of a passage, as a multiple of half of the body's
#   width.
_TURN_RAD, _STEP_RAD, _LEAST_GAIN, NARROWEST = 0.06, 0.005, 0.2, 1.6
# ``_CENTER_GAIN``: share of the difference by which a plan moves the axis in a passage.
# ``_BESIDE_M``: distance from the body within which there is a passage, m.
_CENTER_GAIN, _BESIDE_M = 0.3, 0.15


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
                deviation += min(abs(ordered[k] - middle_one), _MOST_DEVIATION_M)
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
        right, left, deviation = _walls(points, p.middle, begin + n * step, p.half_m[0])
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
    fit_axis(p, points, _TURN_RAD, _STEP_RAD)
    moved, share = math.hypot(p.middle[0] - x, p.middle[1] - y), 0.0
    if moved <= most_m and p.width_m[0] >= NARROWEST * half_width:
        p.maps[0] += 1.0
        share = max(1.0 / p.maps[0], _LEAST_GAIN)
    p.middle[0], p.middle[1] = (
        x + share * (p.middle[0] - x),
        y + share * (p.middle[1] - y),
    )
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
