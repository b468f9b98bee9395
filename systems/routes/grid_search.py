"""Search for the shortest path between two cells of a grid."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from systems.framework.compiling import njit

_DIAGONAL = math.sqrt(2.0)
#: Costs of equal paths may differ by less than this, because their steps add up in
#: different orders.
_ROUNDING = 1e-9
#: The queue has a list of cells for each 1/16 of the bound. A step raises the bound by
#: less than 3, so that 64 lists in turn are enough.
_PER_STEP, _LISTS = 16, 64


@njit(cache=True)
def _bound(di: int, dj: int) -> float:  # pragma: no cover  (compiled)
    """Return the octile distance: the cost of a path if no cell is blocked."""
    i, j = abs(di), abs(dj)
    return max(i, j) + (_DIAGONAL - 1.0) * min(i, j)


@njit(cache=True)
def search_cells(
    blocked: Any, start: tuple[int, int], goal: tuple[int, int]
) -> Any:  # pragma: no cover  (compiled)
    """Searches for a shortest path on a grid with A*, where each cell has 8 neighbors.

    A diagonal step costs sqrt(2) times as much as a straight step. It is possible only
    if both cells beside it are free. The bound of a cell is the cost so far plus the
    octile distance to the goal. The queue consists of lists of cells with nearly equal
    bounds, which is about three times as fast as a binary heap. Cells of the same list
    come in any order. The search therefore visits a cell again if it finds a cheaper
    path to it. It ends when no bound is below the cost of the path found.

    Args:
        blocked: (n, m) whether each cell is blocked.
        start: Start cell as (i, j), the indices along both axes of the grid.
        goal: Goal cell as (i, j).

    Returns:
        (k, 2) indices of the cells from start to goal. The array is empty if start or
        goal is blocked, or if no path connects them.

    Reference: Hart, Nilsson and Raphael (1968); Dial (1969) for the queue.
    """
    n, m = blocked.shape
    # A border of blocked cells makes tests of indices unnecessary.
    width = m + 2
    walls = np.ones((n + 2, width), dtype=np.bool_)
    walls[1:-1, 1:-1] = blocked
    closed = walls.reshape(-1)
    gi, gj = goal[0] + 1, goal[1] + 1
    first, last = (start[0] + 1) * width + start[1] + 1, gi * width + gj
    if closed[first] or closed[last]:
        return np.empty((0, 2), dtype=np.int64)
    cost, before = np.full(closed.size, np.inf), np.empty(closed.size, dtype=np.int32)
    # Lists of the queue: the first cell of each, and the next cell of each cell.
    queued, after = np.zeros(closed.size, np.bool_), np.empty(closed.size, np.int32)
    heads = np.full(_LISTS, -1, dtype=np.int32)
    level = int(_bound(start[0] - goal[0], start[1] - goal[1]) * _PER_STEP)
    cost[first], after[first], heads[level % _LISTS] = 0.0, -1, first
    waiting = 1
    while waiting > 0:
        cell = heads[level % _LISTS]
        if cell < 0:
            level += 1
            continue
        heads[level % _LISTS] = after[cell]
        queued[cell] = False
        waiting -= 1
        i, j = cell // width, cell % width
        if cost[cell] + _bound(gi - i, gj - j) > cost[last] - _ROUNDING:
            continue
        for di in range(-1, 2):
            for dj in range(-1, 2):
                to = cell + di * width + dj
                # A diagonal step must not cut the corner of a blocked cell.
                if closed[to] or closed[cell + di * width] or closed[cell + dj]:
                    continue
                step = _DIAGONAL if di != 0 and dj != 0 else 1.0
                new = cost[cell] + step
                if new > cost[to] - _ROUNDING:
                    continue
                cost[to], before[to] = new, cell
                if queued[to]:
                    continue
                bound = new + _bound(gi - i - di, gj - j - dj)
                k = max(int(bound * _PER_STEP), level) % _LISTS
                after[to], heads[k], queued[to] = heads[k], to, True
                waiting += 1
    if cost[last] == np.inf:
        return np.empty((0, 2), dtype=np.int64)
    # Count the cells of the path, then list them from the goal to the start.
    count, cell = 1, last
    while cell != first:
        cell = before[cell]
        count += 1
    path = np.empty((count, 2), dtype=np.int64)
    cell = last
    for k in range(count - 1, -1, -1):
        path[k, 0], path[k, 1] = cell // width - 1, cell % width - 1
        cell = before[cell]
    return path
