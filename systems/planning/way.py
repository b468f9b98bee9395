"""The cheapest way through seen and unknown space, on cells twice as wide."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from systems.framework.compiling import njit
from systems.safety.free_space import FIRST_I, FIRST_J, NEVER, FreeSpace

#: Price of a cell: seen free; unknown; so that the disc is near, or tight to, what
#: echoed; so that it would lie on what echoed now and then, or often.
FREE, UNKNOWN, NEAR, TIGHT, DOUBTFUL, OCCUPIED = 2, 3, 6, 10, 14, 82
#: Hits of a cell that make it doubtful, and occupied.
_DOUBTFUL_HITS, _OCCUPIED_HITS = 1.5, 6.0
#: So much farther off than it has to be, the disc is tight, or near, m.
_TIGHT_M, _NEAR_M = 0.07, 0.19
#: Of a step to a cell beside and to one across the corner, times its price.
STRAIGHT, ACROSS = 10, 14
#: More than any step costs.
_BUCKETS = 2048
_FAR = 2**31 - 1


class Way(NamedTuple):
    """Cells twice as wide as those of a ``FreeSpace``, and the way through them.

    All arrays are changed by ``find_way``.
    """

    price: NDArray[np.int32]
    """(m, m) of each cell, from ``FREE`` to ``OCCUPIED``."""
    cost: NDArray[np.int32]
    """(m, m) of the way from each cell to the goal, as far as it was looked for."""
    towards: NDArray[np.int32]
    """(m, m) number of the next cell of that way."""
    queue: NDArray[np.int32]
    """(k, 2) number of a cell, and the next entry of its bucket."""
    heads: NDArray[np.int32]
    """(buckets, 1) first entry of each bucket."""
    path: NDArray[np.float64]
    """(p, 2) middles of the cells of the way, from the robot to the goal, m."""
    facts: NDArray[np.float64]
    """(1, 6): points of ``path``, its length, m, the highest price on it, the numbers
    of the first of these cells on the floor, and their side, m."""
    marks: NDArray[np.float64]
    """(q, 3) places that were found blocked, m, and until when that counts, s."""
    marked: NDArray[np.float64]
    """(1, 1) how many places were marked: the oldest is replaced."""


def make_way(cells: int) -> Way:
    """Room for a way.

    Args:
        cells: Of the window along a side.

    Returns:
        The way, of no points.
    """
    size = cells // 2
    grid = size, size
    return Way(
        np.full(grid, UNKNOWN, dtype=np.int32),
        np.full(grid, _FAR, dtype=np.int32),
        np.full(grid, -1, dtype=np.int32),
        np.zeros((8 * size * size + 1, 2), dtype=np.int32),
        np.full((_BUCKETS, 1), -1, dtype=np.int32),
        np.zeros((4 * size, 2)),
        np.zeros((1, 6)),
        np.zeros((16, 3)),
        np.zeros((1, 1)),
    )


@njit(cache=True)
def find_way(
    way: Way,
    space: FreeSpace,
    start: Any,
    goal: Any,
    time: float,
    radius: float,
    clear: Any,
) -> None:  # pragma: no cover  (compiled)
    """Finds the way from a robot to a goal.

    Args:
        way: Changed.
        space: What is known.
        start: (x, y) of the axle, m.
        goal: (x, y); beyond the window the nearest of its cells counts, m.
        time: s.
        radius: Of the disc that must pass, m.
        clear: (n, 3) places, m, and how near to them echoes come from what is followed
            or moves, m, and block no way.
    """
    size, cell = way.price.shape[0], 2.0 * space.cell_m
    low = _first_cells(space)
    _set_prices(way, space, low, time, radius, clear)
    si, sj = _cell_at(start, low, cell, size)
    gi, gj = _cell_at(goal, low, cell, size)
    _search(way, si * size + sj, gi * size + gj)
    points, length, dearest, at = 0, 0.0, 0, si * size + sj
    while points < len(way.path):
        i, j = at // size, at % size
        way.path[points, 0] = (low[0] + i + 0.5) * cell
        way.path[points, 1] = (low[1] + j + 0.5) * cell
        if points > 0:
            length += math.hypot(
                way.path[points, 0] - way.path[points - 1, 0],
                way.path[points, 1] - way.path[points - 1, 1],
            )
            dearest = max(dearest, way.price[i, j])
        points += 1
        if at == gi * size + gj or way.towards[i, j] < 0:
            break
        at = way.towards[i, j]
    way.facts[0, 0], way.facts[0, 1], way.facts[0, 2] = points, length, dearest
    way.facts[0, 3], way.facts[0, 4], way.facts[0, 5] = low[0], low[1], cell


@njit(cache=True)
def mark_blocked(
    way: Way, place: Any, until: float
) -> None:  # pragma: no cover  (compiled)
    """Keeps ways off a place for a time.

    Args:
        way: Changed.
        place: (x, y), m.
        until: When that ends, s.
    """
    k = int(way.marked[0, 0]) % len(way.marks)
    way.marks[k, 0], way.marks[k, 1], way.marks[k, 2] = place[0], place[1], until
    way.marked[0, 0] += 1.0


@njit(cache=True)
def _first_cells(space: FreeSpace) -> tuple[int, int]:  # pragma: no cover  (compiled)
    """Wide cell with which the window begins, as a number on the floor."""
    first_i, first_j = int(space.facts[0, FIRST_I]), int(space.facts[0, FIRST_J])
    return (first_i + 1) // 2, (first_j + 1) // 2


@njit(cache=True)
def _cell_at(
    place: Any, low: Any, cell: float, size: int
) -> tuple[int, int]:  # pragma: no cover  (compiled)
    i = math.floor(place[0] / cell) - low[0]
    j = math.floor(place[1] / cell) - low[1]
    return min(max(i, 0), size - 1), min(max(j, 0), size - 1)


@njit(cache=True)
def _set_prices(
    way: Way,
    space: FreeSpace,
    low: Any,
    time: float,
    radius: float,
    clear: Any,
) -> None:  # pragma: no cover  (compiled)
    size, cells, cell = way.price.shape[0], space.free_until.shape[0], 2 * space.cell_m
    for i in range(size):
        for j in range(size):
            way.price[i, j] = FREE
    for i in range(2 * size):
        for j in range(2 * size):
            at = (2 * low[0] + i) % cells, (2 * low[1] + j) % cells
            if space.free_until[at] == NEVER:
                way.price[i // 2, j // 2] = max(way.price[i // 2, j // 2], UNKNOWN)
            hits = space.hits[at]
            if hits < _DOUBTFUL_HITS:
                continue
            x, y = (low[0] + 0.5 * i + 0.25) * cell, (low[1] + 0.5 * j + 0.25) * cell
            if not _is_near(clear, x, y):
                highest = OCCUPIED if hits >= _OCCUPIED_HITS else DOUBTFUL
                _keep_off(way, (x, y), low, cell, radius, highest)
    for k in range(len(way.marks)):
        if way.marks[k, 2] > time:
            place = way.marks[k, 0], way.marks[k, 1]
            _keep_off(way, place, low, cell, radius, OCCUPIED)


@njit(cache=True)
def _is_near(clear: Any, x: float, y: float) -> bool:  # pragma: no cover  (compiled)
    for k in range(len(clear)):
        if math.hypot(x - clear[k, 0], y - clear[k, 1]) < clear[k, 2]:
            return True
    return False


@njit(cache=True)
def _keep_off(
    way: Way, place: Any, low: Any, cell: float, radius: float, highest: int
) -> None:  # pragma: no cover  (compiled)
    """Gives the cells around a narrow cell at least the prices of their distances."""
    size, x, y = way.price.shape[0], place[0] / cell - low[0], place[1] / cell - low[1]
    reach = (radius + _NEAR_M) / cell
    half = 0.25
    for i in range(max(math.floor(x - reach), 0), min(math.ceil(x + reach), size)):
        for j in range(max(math.floor(y - reach), 0), min(math.ceil(y + reach), size)):
            dx, dy = max(abs(i + 0.5 - x) - half, 0), max(abs(j + 0.5 - y) - half, 0)
            distance = math.sqrt(dx * dx + dy * dy) * cell
            price = FREE
            if distance < radius:
                price = highest
            elif distance < radius + _TIGHT_M:
                price = TIGHT
            elif distance < radius + _NEAR_M:
                price = NEAR
            way.price[i, j] = max(way.price[i, j], price)


@njit(cache=True)
def _search(way: Way, start: int, goal: int) -> None:  # pragma: no cover  (compiled)
    """Dijkstra from the goal up to the start, with buckets for whole costs (Dial)."""
    size = way.price.shape[0]
    way.cost[:, :] = _FAR
    way.towards[:, :] = -1
    way.heads[:, 0] = -1
    way.cost[goal // size, goal % size] = 0
    way.queue[0, 0], way.queue[0, 1] = goal, -1
    way.heads[0, 0] = 0
    entries, waiting, cost = 1, 1, 0
    while waiting > 0:
        entry = way.heads[cost % _BUCKETS, 0]
        if entry < 0:
            cost += 1
            continue
        way.heads[cost % _BUCKETS, 0] = way.queue[entry, 1]
        waiting -= 1
        at = way.queue[entry, 0]
        i, j = at // size, at % size
        if way.cost[i, j] != cost:
            continue
        if at == start:
            return
        for di in range(-1, 2):
            for dj in range(-1, 2):
                a, b = i + di, j + dj
                if (di == 0 and dj == 0) or a < 0 or b < 0 or a >= size or b >= size:
                    continue
                step = STRAIGHT if di == 0 or dj == 0 else ACROSS
                # From there the way leads here: what it costs to enter this cell.
                new = cost + step * way.price[i, j]
                if new < way.cost[a, b] and entries < len(way.queue):
                    way.cost[a, b] = new
                    way.towards[a, b] = at
                    bucket = new % _BUCKETS
                    way.queue[entries, 0] = a * size + b
                    way.queue[entries, 1] = way.heads[bucket, 0]
                    way.heads[bucket, 0] = entries
                    entries += 1
                    waiting += 1
