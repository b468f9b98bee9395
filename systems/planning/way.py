"""Search for the cheapest route through free and unknown space.

The cells of the search are twice as wide as those of the map of free space.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from systems.framework.compiling import njit
from systems.safety.free_space import NEVER, FreeSpace

# Prices of a cell. The last four prices depend on the position of the body's disc if
# its center is in the cell.
# ``FREE``: the cell was seen free.
# ``UNKNOWN``: the cell is unknown.
# ``NEAR``: the disc is near an occupied cell.
# ``TIGHT``: the disc is over an occupied cell or very near it, so that the body may
#   be unable to turn. A body that drives past the cell does not touch it.
# ``DOUBTFUL``: the sides of the body are over a possibly occupied cell.
# ``OCCUPIED``: the sides of the body are over an occupied cell.
FREE, UNKNOWN, NEAR, TIGHT, DOUBTFUL, OCCUPIED = 2, 3, 6, 10, 14, 82
# ``_DOUBTFUL_HITS``: least number of hits of a possibly occupied cell.
# ``_OCCUPIED_HITS``: least number of hits of an occupied cell.
_DOUBTFUL_HITS, _OCCUPIED_HITS = 1.5, 6.0
# ``_TIGHT_M``: gap between the disc and an occupied cell below which the price is
#   ``TIGHT``, m.
# ``_NEAR_M``: gap between the disc and an occupied cell below which the price is
#   ``NEAR``, m.
_TIGHT_M, _NEAR_M = 0.07, 0.19
# A step costs its length times the price of the cell that the step enters.
# ``STRAIGHT``: length of a straight step.
# ``ACROSS``: length of a diagonal step.
STRAIGHT, ACROSS = 10, 14
#: Time for which routes avoid a place that was marked as blocked, s.
MARK_S = 10.0
#: Number of buckets of the queue. This number exceeds the cost of any step.
_BUCKETS = 2048
#: Cost of cells that the search has not reached.
_FAR = 2**31 - 1


class Way(NamedTuple):
    """A route through cells twice as wide as those of a ``FreeSpace``.

    Cell (i, j) of the m x m window has the number i m + j. ``mark_blocked`` changes the
    arrays ``marks`` and ``marked``. ``find_way`` changes all other arrays.
    """

    price: NDArray[np.int32]
    """(m, m) price of each cell, from ``FREE`` to ``OCCUPIED``."""
    cost: NDArray[np.int32]
    """(m, m) cost of the cheapest route from each cell to the goal. The cost is valid
    only for cells that the search has reached.
    """
    toward: NDArray[np.int32]
    """(m, m) number of the next cell on the route to the goal."""
    queue: NDArray[np.int32]
    """(k, 2) number of a cell, and index of the next entry in its bucket."""
    heads: NDArray[np.int32]
    """(buckets, 1) index of the first entry of each bucket."""
    path: NDArray[np.float64]
    """(p, 2) middles of the cells of the route, from the robot to the goal, m."""
    points: NDArray[np.int64]
    """(1,) number of points of ``path``."""
    length_m: NDArray[np.float64]
    """(1,) length of the route, m."""
    dearest: NDArray[np.int64]
    """(1,) highest price of the cells of the route after the first cell."""
    low: NDArray[np.int64]
    """(2,) numbers of the window's first cell on the floor, along x and y."""
    cell_m: NDArray[np.float64]
    """(1,) side of a cell, m."""
    marks: NDArray[np.float64]
    """(q, 3) marks of blocked positions: x and y, m, and the time until which the mark
    counts, s.
    """
    marked: NDArray[np.int64]
    """(1,) number of marks so far; a new mark replaces the oldest."""


def make_way(cells: int) -> Way:
    """Allocates the arrays of a route without points.

    ``cells`` is the number of cells of the map along a side of the window.
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
        np.zeros(1, dtype=np.int64),
        np.zeros(1),
        np.zeros(1, dtype=np.int64),
        np.zeros(2, dtype=np.int64),
        np.zeros(1),
        np.zeros((16, 3)),
        np.zeros(1, dtype=np.int64),
    )


@njit(cache=True)
def find_way(
    way: Way,
    space: FreeSpace,
    start: Any,
    goal: Any,
    time: float,
    widths: Any,
    clear: Any,
) -> None:  # pragma: no cover  (compiled)
    """Finds the cheapest route from the robot to a goal.

    The function sets the prices of all cells, and searches from the goal to the start.
    It then follows the cheapest route, and stores its points, its length, and the
    highest price of its cells.

    Args:
        way: Route and memory of the search. The function changes the arrays in place.
        space: Map with the cells that were seen free and the hits (weighted echoes) of
            the cells.
        start: Position (x, y) of the axle, m.
        goal: Position (x, y) of the goal, m. If the goal is outside the window, the
            route leads to the nearest cell of the window.
        time: Current time, s.
        widths: Half of the width of the body that has to pass, and radius of the disc
            that contains the body, both with margins, m.
        clear: (n, 3) positions (x, y) and radii, m. Hits within these radii do not
            block the route, because they come from the target or from a moving body.
    """
    size, cell, low = way.price.shape[0], 2.0 * space.cell_m, way.low
    way.cell_m[0] = cell
    for axis in range(2):
        low[axis] = (space.first[axis] + 1) // 2
    _set_prices(way, space, time, widths, clear)
    si, sj = cell_at(way, start[0], start[1])
    gi, gj = cell_at(way, goal[0], goal[1])
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
        if at == gi * size + gj or way.toward[i, j] < 0:
            break
        at = way.toward[i, j]
    way.points[0], way.length_m[0], way.dearest[0] = points, length, dearest


@njit(cache=True)
def mark_blocked(
    way: Way, place: Any, until: float
) -> None:  # pragma: no cover  (compiled)
    """Marks a position as blocked, so that routes avoid it for a time.

    ``place`` is the position (x, y), m. The mark counts until the time ``until``, s.
    """
    k = way.marked[0] % len(way.marks)
    way.marks[k, 0], way.marks[k, 1], way.marks[k, 2] = place[0], place[1], until
    way.marked[0] += 1


@njit(cache=True)
def cell_at(
    way: Way, x: float, y: float
) -> tuple[int, int]:  # pragma: no cover  (compiled)
    """Returns the cell of a position, or the nearest cell of the window.

    ``x`` and ``y`` are in the world frame W, m. The result is the two indices of the
    cell in the window, along x and y.
    """
    size, cell = way.price.shape[0], way.cell_m[0]
    i = math.floor(x / cell) - way.low[0]
    j = math.floor(y / cell) - way.low[1]
    return min(max(i, 0), size - 1), min(max(j, 0), size - 1)


@njit(cache=True)
def _set_prices(
    way: Way, space: FreeSpace, time: float, widths: Any, clear: Any
) -> None:  # pragma: no cover  (compiled)
    """Sets the price of each cell from free space, hits, and marks.

    Four narrow cells of the map form one wide cell of the search. A wide cell is
    unknown if one of its narrow cells was never seen free. Narrow cells with enough
    hits raise the prices around them (``_keep_off``), except near the positions in
    ``clear``. Marked positions count as occupied until their time has passed.
    """
    size, cells, cell = way.price.shape[0], space.free_until.shape[0], way.cell_m[0]
    low = way.low
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
            if not is_near(clear, x, y):
                highest = OCCUPIED if hits >= _OCCUPIED_HITS else DOUBTFUL
                _keep_off(way, (x, y), widths, highest)
    for k in range(len(way.marks)):
        if way.marks[k, 2] > time:
            place = way.marks[k, 0], way.marks[k, 1]
            _keep_off(way, place, widths, OCCUPIED)


@njit(cache=True)
def is_near(clear: Any, x: float, y: float) -> bool:  # pragma: no cover  (compiled)
    """Checks whether a point is within the radius of a position in ``clear``."""
    for k in range(len(clear)):
        if math.hypot(x - clear[k, 0], y - clear[k, 1]) < clear[k, 2]:
            return True
    return False


@njit(cache=True)
def _keep_off(
    way: Way, place: Any, widths: Any, highest: int
) -> None:  # pragma: no cover  (compiled)
    """Raises the prices of the wide cells near a narrow cell.

    Within the first of the ``widths`` of the narrow cell, the price is ``highest``.
    Farther away, it is first ``TIGHT`` and then ``NEAR``.
    """
    size, cell = way.price.shape[0], way.cell_m[0]
    x, y = place[0] / cell - way.low[0], place[1] / cell - way.low[1]
    narrow, radius = widths
    reach = (radius + _NEAR_M) / cell
    half = 0.25
    for i in range(max(math.floor(x - reach), 0), min(math.ceil(x + reach), size)):
        for j in range(max(math.floor(y - reach), 0), min(math.ceil(y + reach), size)):
            dx, dy = max(abs(i + 0.5 - x) - half, 0), max(abs(j + 0.5 - y) - half, 0)
            distance = math.sqrt(dx * dx + dy * dy) * cell
            price = FREE
            if distance < narrow:
                price = highest
            elif distance < radius + _TIGHT_M:
                price = TIGHT
            elif distance < radius + _NEAR_M:
                price = NEAR
            way.price[i, j] = max(way.price[i, j], price)


@njit(cache=True)
def _search(way: Way, start: int, goal: int) -> None:  # pragma: no cover  (compiled)
    """Searches with Dijkstra's algorithm from the goal until the start is reached.

    All costs are whole numbers. Therefore a ring of buckets replaces the priority queue
    (Dial's algorithm). Bucket ``cost % _BUCKETS`` is a linked list of the waiting cells
    with this cost. Because every step costs less than the number of buckets, all cells
    in a bucket have the same cost. If the search finds a lower cost for a waiting cell,
    the cell enters the queue again, and the search later skips the older entry.
    """
    size = way.price.shape[0]
    way.cost[:, :] = _FAR
    way.toward[:, :] = -1
    way.heads[:, 0] = -1
    way.cost[goal // size, goal % size] = 0
    way.queue[0, 0], way.queue[0, 1] = goal, -1
    way.heads[0, 0] = 0
    entries, waiting, cost = 1, 1, 0
    while waiting > 0:
        # Take the next cell of the current cost; without one, go to the next bucket.
        entry = way.heads[cost % _BUCKETS, 0]
        if entry < 0:
            cost += 1
            continue
        way.heads[cost % _BUCKETS, 0] = way.queue[entry, 1]
        waiting -= 1
        at = way.queue[entry, 0]
        i, j = at // size, at % size
        # Skip an older entry: the cell has a lower cost by now.
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
                # The path leads from (a, b) to this cell: the step enters this cell.
                new = cost + step * way.price[i, j]
                if new < way.cost[a, b] and entries < len(way.queue):
                    way.cost[a, b] = new
                    way.toward[a, b] = at
                    bucket = new % _BUCKETS
                    way.queue[entries, 0] = a * size + b
                    way.queue[entries, 1] = way.heads[bucket, 0]
                    way.heads[bucket, 0] = entries
                    entries += 1
                    waiting += 1
