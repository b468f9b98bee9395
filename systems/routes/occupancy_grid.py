"""A grid of an arena: the center of a disc must not be in the blocked cells."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from systems.framework.compiling import njit
from systems.framework.input_error import InputError
from systems.world.geometry import beyond_rectangle, rectangle_corners

#: Side of a cell, m. Its ratio to the least clearance is 1/3. With this ratio, the
#: distance of a step between two free cells from an obstacle is at least 97 % of the
#: clearance.
CELL_M = 0.05
#: Margin around the smallest rectangle that contains start, goal and known obstacles,
#: m. Routes stay within this area.
ARENA_MARGIN_M = 2.0
#: Largest number of cells of a grid: a search among them takes 40 MB.
_MOST_CELLS = 1_000_000
#: (n, 3) positions and radii of discs, m; compiled code has no type for it.
Discs = Any


class OccupancyGrid(NamedTuple):
    """Square cells that cover a rectangle of the floor, parallel to the axes of W."""

    blocked: NDArray[np.bool_]
    """(n, m) whether the middle of each cell, along x and y, is too near to an
    obstacle."""
    low: tuple[float, float]
    """Least x and y, m."""


def map_grid(
    points: ArrayLike, rectangles: ArrayLike, clearance_m: float
) -> OccupancyGrid:
    """Makes the grid of a map.

    Args:
        points: (n, 2) start and goal, m.
        rectangles: (k, 5) known obstacles in W, see ``systems.world.geometry``.
        clearance_m: Distance from obstacles below which cells are blocked, m.

    Returns:
        The grid of the area that contains points and obstacles, plus a margin.

    Raises:
        InputError: There are too many cells.
    """
    boxes = np.asarray(rectangles, dtype=float).reshape(-1, 5)
    places = [np.asarray(points, dtype=float), *map(rectangle_corners, boxes)]
    low = np.min([np.min(place, axis=0) for place in places], axis=0) - ARENA_MARGIN_M
    high = np.max([np.max(place, axis=0) for place in places], axis=0) + ARENA_MARGIN_M
    grid = make_occupancy_grid((*low.tolist(), *high.tolist()))
    block_rectangles(grid, boxes, clearance_m)
    return grid


def make_occupancy_grid(arena: tuple[float, float, float, float]) -> OccupancyGrid:
    """Makes a grid of free cells.

    Args:
        arena: Least x and y, and greatest x and y, m.

    Returns:
        The grid.

    Raises:
        InputError: There are too many cells.
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
    """Returns the cell of a place.

    Args:
        grid: The grid.
        x: Position of the place, m.
        y: Position of the place, m.

    Returns:
        Numbers of the cell along x and y. They are (-1, -1) outside the grid.
    """
    i = math.floor((x - grid.low[0]) / CELL_M)
    j = math.floor((y - grid.low[1]) / CELL_M)
    n, m = grid.blocked.shape
    return (i, j) if 0 <= i < n and 0 <= j < m else (-1, -1)


@njit(cache=True)
def cell_middle(
    grid: OccupancyGrid, i: int, j: int
) -> tuple[float, float]:  # pragma: no cover  (compiled)
    """Returns the position of the middle of a cell.

    Args:
        grid: The grid.
        i: Number of the cell along x.
        j: Number of the cell along y.

    Returns:
        (x, y) m.
    """
    return grid.low[0] + (i + 0.5) * CELL_M, grid.low[1] + (j + 0.5) * CELL_M


@njit(cache=True)
def _span(
    low: float, high: float, first: float, count: int
) -> tuple[int, int]:  # pragma: no cover  (compiled)
    """Return the range of cells whose middles may lie in an interval.

    The function returns the first cell of this range, and the cell after its last one.
    """
    begin = math.floor((low - first) / CELL_M - 0.5)
    end = math.ceil((high - first) / CELL_M - 0.5) + 1
    return max(begin, 0), min(end, count)


@njit(cache=True)
def block_rectangles(
    grid: OccupancyGrid, rectangles: Any, radius: float
) -> None:  # pragma: no cover  (compiled)
    """Blocks the cells whose middles are nearer to a rectangle than a radius.

    The function computes exact distances. A distance transform is unsuitable for two
    reasons. It measures between middles of cells, so its error is up to 0.7 cells. In
    addition, compiled steps cannot call it.

    Args:
        grid: Modified in place.
        rectangles: (k, 5) obstacles in W, see ``systems.world.geometry``.
        radius: Radius by which the rectangles are enlarged, m.
    """
    n, m = grid.blocked.shape
    for k in range(len(rectangles)):
        box = rectangles[k]
        # Rectangle along the axes of W that contains the enlarged obstacle.
        c, s = abs(math.cos(box[2])), abs(math.sin(box[2]))
        half_x = 0.5 * (c * box[3] + s * box[4]) + radius
        half_y = 0.5 * (s * box[3] + c * box[4]) + radius
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
    """Blocks the cells whose middles are nearer to a disc than a radius.

    Args:
        grid: Modified in place.
        discs: (n, 3) positions and radii, m.
        radius: Radius by which the discs are enlarged, m.
    """
    n, m = grid.blocked.shape
    for k in range(len(discs)):
        x, y, reach = discs[k, 0], discs[k, 1], discs[k, 2] + radius
        from_i, to_i = _span(x - reach, x + reach, grid.low[0], n)
        from_j, to_j = _span(y - reach, y + reach, grid.low[1], m)
        for i in range(from_i, to_i):
            for j in range(from_j, to_j):
                a, b = cell_middle(grid, i, j)
                if (a - x) ** 2 + (b - y) ** 2 < reach * reach:
                    grid.blocked[i, j] = True
