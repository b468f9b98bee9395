"""Search for the shortest path between two cells of a grid."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from systems.framework.compiling import njit

_DIAGONAL = math.sqrt(2.0)


@njit(cache=True)
def _bound(di: int, dj: int) -> float:  # pragma: no cover  (compiled)
    """Return the octile distance: the cost of a path if no cell is blocked."""
    i, j = abs(di), abs(dj)
    return max(i, j) + (_DIAGONAL - 1.0) * min(i, j)


@njit(cache=True)
def _push(
    bounds: Any, cells: Any, count: int, bound: float, cell: int
) -> None:  # pragma: no cover  (compiled)
    """Add an entry to a binary heap of ``count`` entries, sorted by bound."""
    k = count
    while k > 0:
        above = (k - 1) // 2
        if bounds[above] <= bound:
            break
        bounds[k], cells[k] = bounds[above], cells[above]
        k = above
    bounds[k], cells[k] = bound, cell


@njit(cache=True)
def _pop(bounds: Any, cells: Any, count: int) -> int:  # pragma: no cover  (compiled)
    """Remove the cell with the least bound from a heap of ``count`` entries."""
    least = cells[0]
    last = count - 1
    bound, cell = bounds[last], cells[last]
    k = 0
    while True:
        below = 2 * k + 1
        if below >= last:
            break
        if below + 1 < last and bounds[below + 1] < bounds[below]:
            below += 1
        if bounds[below] >= bound:
            break
        bounds[k], cells[k] = bounds[below], cells[below]
        k = below
    bounds[k], cells[k] = bound, cell
    return int(least)


@njit(cache=True)
def search_cells(
    blocked: Any, start: tuple[int, int], goal: tuple[int, int]
) -> Any:  # pragma: no cover  (compiled)
    """Searches for a shortest path on a grid with A*, where each cell has 8 neighbors.

    A diagonal step costs sqrt(2) times as much as a straight step. It is possible only
    if both cells beside it are free. The priority queue is a binary heap of cells,
    sorted by the cost so far plus the octile distance to the goal. If the search finds
    a cheaper path to a cell, the cell enters the heap again. The search later skips the
    older entries of the cell.

    Args:
        blocked: (n, m) whether each cell is blocked.
        start: Start cell as (i, j), the indices along both axes of the grid.
        goal: Goal cell as (i, j).

    Returns:
        (k, 2) indices of the cells from start to goal. The array is empty if start or
        goal is blocked, or if no path connects them.
    """
    n, m = blocked.shape
    si, sj = start
    gi, gj = goal
    if blocked[si, sj] or blocked[gi, gj]:
        return np.empty((0, 2), dtype=np.int64)
    cost = np.full((n, m), np.inf)
    before = np.full((n, m), -1, dtype=np.int32)
    done = np.zeros((n, m), dtype=np.bool_)
    cost[si, sj] = 0.0
    # A cell enters the heap again when a cheaper way is found: at most once per
    # neighbor.
    bounds, waiting = np.empty(8 * n * m + 1), np.empty(8 * n * m + 1, dtype=np.int32)
    _push(bounds, waiting, 0, 0.0, si * m + sj)
    count = 1
    while count > 0:
        cell = _pop(bounds, waiting, count)
        count -= 1
        i, j = cell // m, cell % m
        if i == gi and j == gj:
            break
        if done[i, j]:
            continue
        done[i, j] = True
        for di in range(-1, 2):
            for dj in range(-1, 2):
                a, b = i + di, j + dj
                if a < 0 or b < 0 or a >= n or b >= m or blocked[a, b] or done[a, b]:
                    continue
                # A diagonal step must not cut the corner of a blocked cell.
                if blocked[a, j] or blocked[i, b]:
                    continue
                step = _DIAGONAL if di != 0 and dj != 0 else 1.0
                new = cost[i, j] + step
                if new < cost[a, b]:
                    cost[a, b], before[a, b] = new, cell
                    bound = new + _bound(gi - a, gj - b)
                    _push(bounds, waiting, count, bound, a * m + b)
                    count += 1
    if cost[gi, gj] == np.inf:
        return np.empty((0, 2), dtype=np.int64)
    # Count the cells of the path, then list them from the goal to the start.
    count, cell = 1, gi * m + gj
    while cell != si * m + sj:
        cell = before[cell // m, cell % m]
        count += 1
    cells = np.empty((count, 2), dtype=np.int64)
    cell = gi * m + gj
    for k in range(count - 1, -1, -1):
        cells[k, 0], cells[k, 1] = cell // m, cell % m
        cell = before[cell // m, cell % m]
    return cells
