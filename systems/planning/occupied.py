"""List of the occupied cells of the map, for the baseline laws.

A cell is occupied if an echo came from it and no sensor has seen it free since. All
other cells count as free, also those that no sensor has seen.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from systems.framework.compiling import njit
from systems.safety.free_space import FreeSpace, cells_within

# ``_LEAST_HITS``: least number of hits of an occupied cell.
# ``_MOST_HITS``: number of hits above which the certainty does not increase.
_LEAST_HITS, _MOST_HITS = 1.0, 6.0
#: Distance from the target within which echoes may be echoes of the target, m.
SOURCE_CLEARANCE_M = 0.5


@njit(cache=True)
def list_occupied(
    space: FreeSpace, x: float, y: float, reach: float
) -> NDArray[np.float64]:  # pragma: no cover  (compiled)
    """Lists the occupied cells in a square around a position.

    Args:
        space: Map with the hits (weighted echoes) of the cells.
        x: Position, x in the world frame W, m.
        y: Position, y in W, m.
        reach: Half of the side of the square, m.

    Returns:
        (n, 3) array with one row per cell: x and y of the middle, m, and the certainty
        that the cell is occupied, 0 to 1.
    """
    cell, cells = space.cell_m, space.hits.shape[0]
    low_i, low_j, high_i, high_j = cells_within(
        space, x - reach, y - reach, x + reach, y + reach
    )
    most = max(high_i - low_i + 1, 0) * max(high_j - low_j + 1, 0)
    found, count = np.empty((most, 3)), 0
    for i in range(low_i, high_i + 1):
        row, at = space.hits[i % cells], low_j % cells - 1
        for j in range(low_j, high_j + 1):
            at = at + 1 if at + 1 < cells else 0
            if row[at] >= _LEAST_HITS:
                found[count, 0] = (i + 0.5) * cell
                found[count, 1] = (j + 0.5) * cell
                found[count, 2] = min(row[at], _MOST_HITS) / _MOST_HITS
                count += 1
    return found[:count]
