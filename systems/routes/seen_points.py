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


class SeenPoints(NamedTuple):
    """The first point seen in each cell; changed by ``remember_objects``."""

    points: NDArray[np.float64]
    """(k, 2) in W, m."""
    taken: NDArray[np.bool_]
    """(n, m) cells of the grid that have a point."""
    added: NDArray[np.int64]
    """(1,) number of points remembered so far; a new point replaces the oldest."""


def make_seen_points(grid: OccupancyGrid) -> SeenPoints:
    """Returns an empty memory for a grid."""
    return SeenPoints(
        np.zeros((min(_MOST_POINTS, grid.blocked.size), 2)),
        np.zeros(grid.blocked.shape, dtype=np.bool_),
        np.zeros(1, dtype=np.int64),
    )


@njit(cache=True)
def remember_objects(
    seen: SeenPoints, grid: OccupancyGrid, rectangles: Any, objects: Any, p_WP: Any
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
        if i < 0 or seen.taken[i, j]:
            continue
        if is_on_map(x, y, rectangles):
            continue
        # With a full memory, replace the oldest point.
        most = len(seen.points)
        k = seen.added[0] % most
        if seen.added[0] >= most:
            old_i, old_j = cell_of(grid, seen.points[k, 0], seen.points[k, 1])
            seen.taken[old_i, old_j] = False
        seen.points[k, 0], seen.points[k, 1] = x, y
        seen.taken[i, j] = True
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
