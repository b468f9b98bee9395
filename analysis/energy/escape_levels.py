"""Computes escape energies on a grid of cells.

Every path from a cell to contact with a body has a largest potential energy. The escape
energy of the cell is the smallest of these values over all paths. Module
``analysis.energy.energy_certificate`` explains what escape energies prove.
"""

from __future__ import annotations

import heapq
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.loops.point_mass import PointMass
from systems.framework.compiling import njit


def cell_bounds(
    model: PointMass, points: NDArray[np.float64], cell_m: float, contact_m: float
) -> tuple[NDArray[Any], ...]:
    """Computes bounds of the potential energy in grid cells, and cells in contact.

    Args:
        model: Point-mass model with the bodies and the potential.
        points: (n, 2) centers of square cells, m.
        cell_m: Side of the cells, m.
        contact_m: Distance from the robot's control point to a body that counts as
            contact, m.

    Returns:
        Four arrays:

        1. (n,) least potential in each cell, J.
        2. (n,) largest potential in each cell, J.
        3. (bodies, n) least potential at the distance ``contact_m`` from each body, J.
           If no point of a cell has this distance from the body, it is infinite.
        4. (n,) whether all points of the cell are in contact with a body.
    """
    radius = cell_m / math.sqrt(2.0)
    r = np.hypot(*(points - model.p_WS).T)
    distances = model.distances(points)
    stretch = np.abs(r - model.follow_distance_m)
    # Near the source, |p_S - p| cannot decrease by the whole radius.
    nearest = model.follow_distance_m + np.maximum(stretch - radius, 0.0)
    farthest = model.follow_distance_m + stretch + radius
    pull_low = model.attraction_energy(nearest)
    lower = pull_low + model.obstacle_energy(distances + radius)
    upper = model.attraction_energy(farthest) + model.obstacle_energy(
        np.maximum(distances - radius, 0.0)
    )
    repulsion = np.maximum(
        model.law.energy(contact_m), model.obstacle_energy(distances + radius)
    )
    contact = np.abs(distances.T - contact_m) <= radius
    seeds = np.where(contact, pull_low + repulsion, np.inf)
    blocked = distances.min(axis=1) + radius < contact_m
    return lower, upper, seeds, blocked


def border_cells(cells: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Marks the cells along the border, where paths may leave the grid and return.

    ``cells`` is any (nx, ny) array. The result has the same shape.
    """
    border = np.ones(cells.shape, dtype=bool)
    border[1:-1, 1:-1] = False
    return border


@njit(cache=True)
def climb(
    lower: NDArray[np.float64], seeds: NDArray[np.float64], blocked: NDArray[np.bool_]
) -> NDArray[np.float64]:  # pragma: no cover  (compiled)
    """Computes the escape energy of each cell: the least energy that reaches a contact.

    It is the minimum, over all paths from the cell to contact with one body, of the
    largest energy on the path. The algorithm is Dijkstra's, with this largest energy
    instead of a sum as the cost of a path. Cells are settled in ascending order of
    their escape energies. Paths may go to all eight neighbors of a cell.

    Args:
        lower: (nx, ny) least potential in each cell, J.
        seeds: (nx, ny) energy at contact within the cell, J; infinite without contact.
        blocked: (nx, ny) whether all points of a cell are in contact. No path crosses
            these cells.

    Returns:
        (nx, ny) escape energies, J; infinite if no path leads to contact.
    """
    nx, ny = lower.shape
    level = np.full((nx, ny), np.inf)
    heap = [(0.0, -1, -1)]
    heap.pop()
    for i in range(nx):
        for j in range(ny):
            if np.isfinite(seeds[i, j]):
                level[i, j] = seeds[i, j]
                heapq.heappush(heap, (level[i, j], i, j))
    while len(heap) > 0:
        height, i, j = heapq.heappop(heap)
        if height > level[i, j]:
            continue
        for a in range(max(i - 1, 0), min(i + 2, nx)):
            for b in range(max(j - 1, 0), min(j + 2, ny)):
                over = max(height, lower[a, b])
                if not blocked[a, b] and over < level[a, b]:
                    level[a, b] = over
                    heapq.heappush(heap, (over, a, b))
    return level
