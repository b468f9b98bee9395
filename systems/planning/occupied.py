"""Occupied cells: echoes came from them, and no sensor has seen them free since.

This is the map of the baselines: an occupancy grid that does not distinguish unknown
cells from free ones.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from systems.framework.compiling import njit
from systems.safety.free_space import FreeSpace, cells_within

#: A cell with fewer hits than the first number is not occupied. More hits than the
#: second number do not make it more certain.
_LEAST_HITS, _MOST_HITS = 1.0, 6.0


@njit(cache=True)
def list_occupied(
    space: FreeSpace, x: float, y: float, reach: float, clear: Any
) -> NDArray[np.float64]:  # pragma: no cover  (compiled)
    """Lists the occupied cells around a place.

    Args:
        space: Hits of the cells.
        x: Position of the place, m.
        y: Position of the place, m.
        reach: Half of the side of the square in which cells are listed, m.
        clear: (x, y, radius) of the followed target, m. Cells within this radius are
            not listed.

    Returns:
        (n, 3) middle (x, y) of each cell, m, and certainty from 0 to 1 that the cell is
        occupied.
    """
    cell, cells = space.cell_m, space.hits.shape[0]
    found, count = np.empty((64, 3)), 0
    low_i, low_j, high_i, high_j = cells_within(
        space, x - reach, y - reach, x + reach, y + reach
    )
    for i in range(low_i, high_i + 1):
        row = space.hits[i % cells]
        for j in range(low_j, high_j + 1):
            hits = row[j % cells]
            if hits < _LEAST_HITS:
                continue
            px, py = (i + 0.5) * cell, (j + 0.5) * cell
            if math.hypot(px - clear[0], py - clear[1]) < clear[2]:
                continue
            if count == len(found):
                more = np.empty((2 * count, 3))
                more[:count] = found
                found = more
            found[count, 0], found[count, 1] = px, py
            found[count, 2] = min(hits, _MOST_HITS) / _MOST_HITS
            count += 1
    return found[:count]
