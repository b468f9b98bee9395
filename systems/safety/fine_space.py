"""Fine cells around a long body, and the ones among them that it has to avoid."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from systems.framework.compiling import njit
from systems.safety.free_space import PARTS, FreeSpace, free_cells
from systems.safety.outline import Outline, frame_at, gaps


@njit(cache=True)
def free_fine_cells(
    space: FreeSpace, low_i: int, low_j: int, high_i: int, high_j: int, until: float
) -> NDArray[np.bool_]:  # pragma: no cover  (compiled)
    """Checks which fine cells of a rectangle are free.

    A fine cell is free if it was seen free itself, or if it belongs to a free cell.

    Args:
        space: Map of free space with fine cells.
        low_i: Least index of a fine cell on the floor along x.
        low_j: Least index along y.
        high_i: Greatest index along x.
        high_j: Greatest index along y.
        until: A cell is free if it counts as free until the wheels have rolled this
            mean distance since the start, m.

    Returns:
        Array with one element for each fine cell of the rectangle.
    """
    free = free_cells(space.fine, low_i, low_j, high_i, high_j, until)
    low_a, low_b = low_i // PARTS, low_j // PARTS
    wide = free_cells(space, low_a, low_b, high_i // PARTS, high_j // PARTS, until)
    for a in range(wide.shape[0]):
        begin_i = max((low_a + a) * PARTS - low_i, 0)
        end_i = min((low_a + a + 1) * PARTS - low_i, free.shape[0])
        for b in range(wide.shape[1]):
            if wide[a, b]:
                begin_j = max((low_b + b) * PARTS - low_j, 0)
                end_j = min((low_b + b + 1) * PARTS - low_j, free.shape[1])
                free[begin_i:end_i, begin_j:end_j] = True
    return free


@njit(cache=True)
def fine_edge(
    space: FreeSpace,
    pose: Any,
    reach: float,
    until: float,
    outline: Outline,
    least_m: float,
    out: Any,
) -> int:  # pragma: no cover  (compiled)
    """Lists the non-free fine cells near the robot that are next to free space.

    Non-free cells that are within a distance of the outline are listed, too, because
    they may have no free neighbor.

    Args:
        space: Map of free space with fine cells.
        pose: Pose (x, y, theta) of the body, m and rad.
        reach: Half of the side of the square around the axle whose cells are listed, m.
        until: A cell is free if it counts as free until the wheels have rolled this
            mean distance since the start, m.
        outline: Outline of the body.
        least_m: Distance from the outline within which all non-free cells count, m.
        out: (m, 2) array that the function fills with one corner of each cell: least x
            and least y, m.

    Returns:
        Number of cells in ``out``.
    """
    cell, count, x, y = space.fine.cell_m, 0, pose[0], pose[1]
    frame, near = frame_at(pose, cell), outline.radius_m + least_m + 2.0 * cell
    low_i, low_j = math.floor((x - reach) / cell), math.floor((y - reach) / cell)
    high_i, high_j = math.floor((x + reach) / cell), math.floor((y + reach) / cell)
    # The square, enlarged by one cell on each side.
    free = free_fine_cells(space, low_i - 1, low_j - 1, high_i + 1, high_j + 1, until)
    for a in range(1, free.shape[0] - 1):
        for b in range(1, free.shape[1] - 1):
            if free[a, b]:
                continue
            corner = (low_i - 1 + a) * cell, (low_j - 1 + b) * cell
            listed = free[a - 1, b] or free[a + 1, b]
            listed = listed or free[a, b - 1] or free[a, b + 1]
            if not listed and abs(corner[0] - x) < near and abs(corner[1] - y) < near:
                now = gaps(corner, cell, frame, outline)
                listed = max(now[0], now[1], now[2]) < least_m
            if listed and count < len(out):
                out[count, 0], out[count, 1] = corner
                count += 1
    return count
