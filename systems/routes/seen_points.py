"""What a robot remembers of the objects that it has seen, for planning anew."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from systems.framework.compiling import njit
from systems.ranging.objects import KNOWN, RADIUS, ROBOT, THERE, VX, VY, X, Y
from systems.ranging.parameters import OBJECT_SIZE, OBJECT_SLOTS
from systems.routes.occupancy_grid import OccupancyGrid, cell_of
from systems.routes.route import place_clearance

#: Points that are remembered at most; then the oldest are forgotten.
_MOST_POINTS = 4_000
#: What is known to be slower rests, m/s.
_RESTS_M_S = 0.02


class SeenPoints(NamedTuple):
    """The first point that was seen in each cell; changed by ``remember_objects``."""

    points: NDArray[np.float64]
    """(k, 2) in W, m."""
    taken: NDArray[np.bool_]
    """(n, m) cells of the grid that have one."""
    added: NDArray[np.int64]
    """(1,) how many were remembered: the oldest is replaced."""


def make_seen_points(grid: OccupancyGrid) -> SeenPoints:
    """An empty memory for a grid."""
    return SeenPoints(
        np.zeros((min(_MOST_POINTS, grid.blocked.size), 2)),
        np.zeros(grid.blocked.shape, dtype=np.bool_),
        np.zeros(1, dtype=np.int64),
    )


@njit(cache=True)
def _moves(objects: Any, at: int) -> bool:  # pragma: no cover  (compiled)
    speed = math.hypot(objects[at + VX], objects[at + VY])
    return objects[at + KNOWN] > 0.5 and speed > _RESTS_M_S


@njit(cache=True)
def remember_objects(
    seen: SeenPoints, grid: OccupancyGrid, rectangles: Any, objects: Any, p_WP: Any
) -> None:  # pragma: no cover  (compiled)
    """Remembers the nearest points of what is there and is not known to move.

    Robots move, sooner or later, and what is known need not be remembered.

    Args:
        seen: Changed.
        grid: For its cells.
        rectangles: (k, 5) known obstacles in W.
        objects: (64,) as the port ``objects_W``.
        p_WP: (x, y) of P, m.
    """
    for slot in range(OBJECT_SLOTS):
        at = slot * OBJECT_SIZE
        if objects[at + THERE] < 0.5 or objects[at + ROBOT] > 0.5:
            continue
        if _moves(objects, at):
            continue
        x, y = p_WP[0] + objects[at + X], p_WP[1] + objects[at + Y]
        i, j = cell_of(grid, x, y)
        if i < 0 or seen.taken[i, j]:
            continue
        if place_clearance(x, y, rectangles, np.empty((0, 3))) < grid.cell_m:
            continue
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
) -> Any:  # pragma: no cover  (compiled)
    """All that a route has to keep off now: what was seen, and robots that rest.

    Args:
        seen: What is remembered.
        objects: (64,) as the port ``objects_W``.
        p_WP: (x, y) of P, m.

    Returns:
        (n, 3) places and radii of discs, m.
    """
    count = min(seen.added[0], len(seen.points))
    discs = np.zeros((count + OBJECT_SLOTS, 3))
    for k in range(count):
        discs[k, 0], discs[k, 1] = seen.points[k, 0], seen.points[k, 1]
    for slot in range(OBJECT_SLOTS):
        at = slot * OBJECT_SIZE
        if objects[at + THERE] < 0.5 or objects[at + ROBOT] < 0.5:
            continue
        if _moves(objects, at):
            continue
        x, y, radius = objects[at + X], objects[at + Y], objects[at + RADIUS]
        # The disc lies behind its nearest point.
        longer = 1.0 + radius / max(math.hypot(x, y), 1e-9)
        discs[count, 0], discs[count, 1] = p_WP[0] + longer * x, p_WP[1] + longer * y
        discs[count, 2] = radius
        count += 1
    return discs[:count].copy()
