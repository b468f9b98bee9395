"""Levels over which paths to contact must climb, on a grid of cells.

``analysis.certificates.energy_certificate`` says what they prove.
"""

from __future__ import annotations

import heapq
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.models.point_mass import PointMass
from systems.framework.compiling import njit


def cell_bounds(
    model: PointMass, points: NDArray[np.float64], cell_m: float, contact_m: float
) -> tuple[NDArray[Any], ...]:
    """Per cell: least and largest potential, energy at contact, inside contact.

    The third has a row a body; it is infinite where the cell holds no point of
    contact with it.

    Args:
        model: Bodies and potential.
        points: (n, 2) centres of square cells, m.
        cell_m: Side of the cells, m.
        contact_m: P nearer to a body than this is in contact, m.

    Returns:
        Least and largest potential (n,), J, energy at contact (bodies, n), J, and (n,)
        whether all of the cell is in contact.
    """
    radius = cell_m / math.sqrt(2.0)
    r = np.hypot(*(points - model.p_WS).T)
    distances = model.distances(points)
    stretch = np.abs(r - model.follow_distance_m)
    # At the source itself |p_S - p| cannot shrink by the whole radius.
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
    """The cells along the border: a path may leave the grid and return."""
    border = np.ones(cells.shape, dtype=bool)
    border[1:-1, 1:-1] = False
    return border


@njit(cache=True)
def climb(
    lower: NDArray[np.float64], seeds: NDArray[np.float64], blocked: NDArray[np.bool_]
) -> NDArray[np.float64]:  # pragma: no cover  (compiled)
    """Lowest level over which a path from each cell to contact must climb.

    Dijkstra's algorithm with the largest instead of the sum: cells are settled
    in the order of their levels; paths go to all eight neighbours.

    Args:
        lower: (nx, ny) least potential in each cell, J.
        seeds: (nx, ny) energy at contact within the cell, J; infinite where there is
            none.
        blocked: (nx, ny) cells wholly in contact, which no path crosses.

    Returns:
        (nx, ny) J; infinite where no path leads to contact.
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
