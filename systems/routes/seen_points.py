"""Memory of the objects that a robot has seen, for the planning of new routes."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from systems.framework.compiling import njit
from systems.ranging.objects import (
    RADIUS,
    ROBOT,
    THERE,
    X,
    Y,
    is_moving,
    is_on_map,
)
from systems.ranging.parameters import OBJECT_SIZE, OBJECT_SLOTS
from systems.routes.occupancy_grid import (
    CELL_M,
    Discs,
    OccupancyGrid,
    cell_of,
    sorted_discs,
)

#: Largest number of remembered points; further points replace the oldest.
_MOST_POINTS = 4_000
#: Objects farther away than this are not remembered, m (our choice). The beams of a
#: lidar are so far apart there that the nearest point of a wall may be off the wall.
_REACH_M = 2.0
#: An object is seen to be at rest if it stays within ``_SAME_M``, m, of a point for
#: ``_REST_S``, s (our choice). It is then slower than about 0.05 m/s.
_SAME_M, _REST_S = 0.15, 3.0
#: If nothing was seen at a point for longer than this, the time starts again, s.
_GAP_S = 1.0
#: Indices of ``SeenPoints.times_s``.
_FIRST, _LAST = range(2)


class SeenPoints(NamedTuple):
    """The first point seen in each cell; changed by ``remember_objects``."""

    points: NDArray[np.float64]
    """(k, 2) in W, m."""
    times_s: NDArray[np.float64]
    """(k, 2) first and last time at which an object was at each point, s."""
    rows: NDArray[np.int32]
    """(n, m) row of the point in each cell of the grid, or -1."""
    added: NDArray[np.int64]
    """(1,) number of points remembered so far; a new point replaces the oldest."""


def make_seen_points(grid: OccupancyGrid) -> SeenPoints:
    """Returns an empty memory for a grid."""
    most = min(_MOST_POINTS, grid.blocked.size)
    return SeenPoints(
        np.zeros((most, 2)),
        np.zeros((most, 2)),
        np.full(grid.blocked.shape, -1, dtype=np.int32),
        np.zeros(1, dtype=np.int64),
    )


@njit(cache=True)
def is_at_rest(seen: SeenPoints, k: int) -> bool:  # pragma: no cover  (compiled)
    """Checks whether an object was seen to be at rest at the point in row ``k``."""
    return bool(seen.times_s[k, _LAST] - seen.times_s[k, _FIRST] >= _REST_S)


@njit(cache=True)
def _see_again(
    seen: SeenPoints, cell: tuple[int, int], x: float, y: float, time_s: float
) -> None:  # pragma: no cover  (compiled)
    """Notes the time at all points near (x, y), which is in ``cell``."""
    (i, j), (n, m), near = cell, seen.rows.shape, math.ceil(_SAME_M / CELL_M)
    for a in range(max(i - near, 0), min(i + near + 1, n)):
        for b in range(max(j - near, 0), min(j + near + 1, m)):
            k = seen.rows[a, b]
            if k < 0:
                continue
            if math.hypot(seen.points[k, 0] - x, seen.points[k, 1] - y) > _SAME_M:
                continue
            times = seen.times_s[k]
            if time_s > times[_LAST] + _GAP_S and not is_at_rest(seen, k):
                times[_FIRST] = time_s
            times[_LAST] = time_s


@njit(cache=True)
def remember_objects(
    seen: SeenPoints,
    grid: OccupancyGrid,
    rectangles: Any,
    objects: Any,
    p_WP: Any,
    time_s: float,
) -> None:  # pragma: no cover  (compiled)
    """Remembers the nearest points of the objects that are not known to move.

    The function ignores other robots, because they will move sooner or later. It also
    ignores parts of known obstacles (``is_on_map``).

    Args:
        seen: Memory of points, modified in place.
        grid: Grid of the floor. The function remembers at most one point per cell.
        rectangles: (k, 6) rectangles of known obstacles (x, y, theta, length, width,
            radius) in the world frame W, m and rad.
        objects: (64,) value of the port ``objects_W``, which lists the seen objects.
        p_WP: (x, y) of the control point P in W, m.
        time_s: Present time, s.
    """
    for slot in range(OBJECT_SLOTS):
        at = slot * OBJECT_SIZE
        if objects[at + THERE] < 0.5 or objects[at + ROBOT] > 0.5:
            continue
        if is_moving(objects, at):
            continue
        if math.hypot(objects[at + X], objects[at + Y]) > _REACH_M:
            continue
        x, y = p_WP[0] + objects[at + X], p_WP[1] + objects[at + Y]
        i, j = cell_of(grid, x, y)
        if i < 0:
            continue
        _see_again(seen, (i, j), x, y, time_s)
        if seen.rows[i, j] >= 0:
            continue
        if is_on_map(x, y, rectangles):
            continue
        # With a full memory, replace the oldest point.
        most = len(seen.points)
        k = seen.added[0] % most
        if seen.added[0] >= most:
            old_i, old_j = cell_of(grid, seen.points[k, 0], seen.points[k, 1])
            seen.rows[old_i, old_j] = -1
        seen.points[k, 0], seen.points[k, 1] = x, y
        seen.times_s[k] = time_s
        seen.rows[i, j] = k
        seen.added[0] += 1


@njit(cache=True)
def discs_to_avoid(
    seen: SeenPoints, objects: Any, p_WP: Any
) -> Discs:  # pragma: no cover  (compiled)
    """Lists the discs that a new route has to avoid: seen points and robots at rest.

    Args:
        seen: Remembered points.
        objects: (64,) value of the port ``objects_W``, which lists the seen objects.
        p_WP: (x, y) of the control point P in the world frame W, m.

    Returns:
        The discs. Seen points have the radius 0.
    """
    count = min(seen.added[0], len(seen.points))
    discs = np.zeros((count + OBJECT_SLOTS, 3))
    for k in range(count):
        discs[k, 0], discs[k, 1] = seen.points[k, 0], seen.points[k, 1]
    for slot in range(OBJECT_SLOTS):
        at = slot * OBJECT_SIZE
        if objects[at + THERE] < 0.5 or objects[at + ROBOT] < 0.5:
            continue
        if is_moving(objects, at):
            continue
        x, y, radius = objects[at + X], objects[at + Y], objects[at + RADIUS]
        # The middle of the disc is behind its nearest point.
        longer = 1.0 + radius / max(math.hypot(x, y), 1e-9)
        discs[count, 0], discs[count, 1] = p_WP[0] + longer * x, p_WP[1] + longer * y
        discs[count, 2] = radius
        count += 1
    return sorted_discs(discs[:count])
