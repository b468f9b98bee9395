"""A grid of cells; the center of a disc-shaped robot must not be in a blocked cell."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from systems.framework.compiling import njit
from systems.framework.input_error import InputError
from systems.world.geometry import beyond_rectangle
from systems.world.shapes import rectangle_outline

#: Side of a cell, m. The side is 1/3 of the least possible clearance. A straight step
#: between two free cells therefore keeps at least 97 % of the clearance.
CELL_M = 0.05
#: Margin of the grid, m. The grid covers start, goal, known obstacles, and this margin
#: around them. Routes stay on the grid.
ARENA_MARGIN_M = 2.0
#: Largest number of cells of a grid. A search on such a grid takes 40 MB of memory.
_MOST_CELLS = 1_000_000


class Discs(NamedTuple):
    """Discs on the floor, in the order of x; made by ``sorted_discs``."""

    rows: NDArray[np.float64]
    """(n, 3) middles x and y in the world frame W, and radii, m."""
    largest: float
    """Largest radius, m."""


@njit(cache=True)
def sorted_discs(rows: Any) -> Discs:  # pragma: no cover  (compiled)
    """Sorts discs, so that a search for near discs skips those far away along x.

    Args:
        rows: (n, 3) discs. Each row is (x, y, radius), m, in the world frame W.

    Returns:
        The sorted discs.
    """
    # A stable sort gives the same order of equal x on each machine.
    order = np.argsort(rows[:, 0], kind="mergesort")
    largest = 0.0
    for k in range(len(rows)):
        largest = max(largest, rows[k, 2])
    return Discs(rows[order], largest)


class OccupancyGrid(NamedTuple):
    """Square cells that cover a rectangle of the floor, parallel to the axes of W."""

    blocked: NDArray[np.bool_]
    """(n, m) whether each cell is blocked, because its middle is too near to an
    obstacle. The first axis is x, and the second is y.
    """
    low: tuple[float, float]
    """Least x and y, m."""


def free_grid(points: ArrayLike, rectangles: ArrayLike) -> OccupancyGrid:
    """Makes a grid of free cells that covers start, goal and known obstacles.

    Args:
        points: (n, 2) start and goal in the world frame W, m.
        rectangles: (k, 6) rectangles of known obstacles (x, y, theta, length, width,
            radius) in W, m and rad.

    Returns:
        The grid. It covers all points and obstacles, plus a margin of 2 m.

    Raises:
        InputError: The grid would have too many cells.
    """
    boxes = np.asarray(rectangles, dtype=float).reshape(-1, 6)
    places = [np.asarray(points, dtype=float), *map(rectangle_outline, boxes)]
    low = np.min([np.min(place, axis=0) for place in places], axis=0) - ARENA_MARGIN_M
    high = np.max([np.max(place, axis=0) for place in places], axis=0) + ARENA_MARGIN_M
    return make_occupancy_grid((*low.tolist(), *high.tolist()))


def make_occupancy_grid(arena: tuple[float, float, float, float]) -> OccupancyGrid:
    """Makes a grid of free cells that covers a rectangle of the floor.

    ``arena`` is (least x, least y, greatest x, greatest y) in the world frame W, m. If
    the grid would have too many cells, the function raises an ``InputError``.
    """
    low_x, low_y, high_x, high_y = arena
    size = [
        max(math.ceil(extent / CELL_M - 1e-9), 1)
        for extent in (high_x - low_x, high_y - low_y)
    ]
    if size[0] * size[1] > _MOST_CELLS:
        raise InputError(
            "goal_m",
            f"start, goal and known obstacles spread over {high_x - low_x:.3g} m x "
            f"{high_y - low_y:.3g} m, which makes more than {_MOST_CELLS} cells of "
            f"{CELL_M:g} m; move them together",
        )
    return OccupancyGrid(np.zeros(size, dtype=np.bool_), (low_x, low_y))


@njit(cache=True)
def cell_of(
    grid: OccupancyGrid, x: float, y: float
) -> tuple[int, int]:  # pragma: no cover  (compiled)
    """Returns the cell that contains a point of the floor.

    ``x`` and ``y`` are in the world frame W, m. The result is (i, j), the indices of
    the cell along x and y, or (-1, -1) if the point is outside the grid.
    """
    i = math.floor((x - grid.low[0]) / CELL_M)
    j = math.floor((y - grid.low[1]) / CELL_M)
    n, m = grid.blocked.shape
    return (i, j) if 0 <= i < n and 0 <= j < m else (-1, -1)


@njit(cache=True)
def cell_middle(
    grid: OccupancyGrid, i: int, j: int
) -> tuple[float, float]:  # pragma: no cover  (compiled)
    """Returns the middle (x, y) of cell (i, j) in the world frame W, m."""
    return grid.low[0] + (i + 0.5) * CELL_M, grid.low[1] + (j + 0.5) * CELL_M


@njit(cache=True)
def _span(
    low: float, high: float, first: float, count: int
) -> tuple[int, int]:  # pragma: no cover  (compiled)
    """Returns the cells along one axis whose middles may lie in an interval.

    Returns:
        Index of the first of these cells, and index after the last of them.
    """
    begin = math.floor((low - first) / CELL_M - 0.5)
    end = math.ceil((high - first) / CELL_M - 0.5) + 1
    return max(begin, 0), min(end, count)


@njit(cache=True)
def block_rectangles(
    grid: OccupancyGrid, rectangles: Any, radius: float
) -> None:  # pragma: no cover  (compiled)
    """Marks cells as blocked if their middles are too near to a rectangle.

    The function computes exact distances. A distance transform would measure between
    middles of cells, with errors of up to 0.7 cells. Compiled steps of blocks could not
    call it either.

    Args:
        grid: The grid, modified in place.
        rectangles: (k, 6) rectangles of obstacles (x, y, theta, length, width,
            radius) in the world frame W, m and rad.
        radius: Distance from the rectangles below which cells are blocked, m.
    """
    n, m = grid.blocked.shape
    for k in range(len(rectangles)):
        box = rectangles[k]
        # Rectangle along the axes of W that contains the enlarged obstacle.
        c, s = abs(math.cos(box[2])), abs(math.sin(box[2]))
        half_x = 0.5 * (c * box[3] + s * box[4]) + box[5] + radius
        half_y = 0.5 * (s * box[3] + c * box[4]) + box[5] + radius
        low_x, high_x = box[0] - half_x, box[0] + half_x
        low_y, high_y = box[1] - half_y, box[1] + half_y
        from_i, to_i = _span(low_x, high_x, grid.low[0], n)
        from_j, to_j = _span(low_y, high_y, grid.low[1], m)
        for i in range(from_i, to_i):
            for j in range(from_j, to_j):
                if not grid.blocked[i, j]:
                    du, dv = beyond_rectangle(cell_middle(grid, i, j), box)
                    grid.blocked[i, j] = du * du + dv * dv < radius * radius


@njit(cache=True)
def block_discs(
    grid: OccupancyGrid, discs: Discs, radius: float
) -> None:  # pragma: no cover  (compiled)
    """Marks cells as blocked if their middles are too near to a disc.

    Args:
        grid: The grid, modified in place.
        discs: The discs.
        radius: Distance from the edges of the discs below which cells are blocked, m.
    """
    n, m = grid.blocked.shape
    for disc in discs.rows:
        x, y, reach = disc[0], disc[1], disc[2] + radius
        from_i, to_i = _span(x - reach, x + reach, grid.low[0], n)
        from_j, to_j = _span(y - reach, y + reach, grid.low[1], m)
        for i in range(from_i, to_i):
            for j in range(from_j, to_j):
                a, b = cell_middle(grid, i, j)
                if (a - x) ** 2 + (b - y) ** 2 < reach * reach:
                    grid.blocked[i, j] = True
