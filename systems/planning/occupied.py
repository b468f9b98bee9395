"""Places from which range sensors had echoes, as far as they were not seen free since.

The map of baselines, which know no more of space: an occupancy grid without the
unknown.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from systems.framework.compiling import njit
from systems.safety.free_space import FIRST_I, FIRST_J, FreeSpace

#: From a cell with fewer hits nothing has echoed for sure; more of them do not count.
_LEAST_HITS, _MOST_HITS = 1.0, 6.0


@njit(cache=True)
def list_occupied(
    space: FreeSpace, x: float, y: float, reach: float, clear: Any
) -> NDArray[np.float64]:  # pragma: no cover  (compiled)
    """Cells that have echoed, around a place.

    Args:
        space: What is known.
        x: The place, m.
        y: See x.
        reach: Cells within a square of this half side, m.
        clear: (x, y, radius) of what is followed, m: its echoes do not count.

    Returns:
        (n, 3) middles, m, and how certain they are, 0 to 1.
    """
    cell, cells = space.cell_m, space.hits.shape[0]
    found, count = np.empty((64, 3)), 0
    low_i = max(math.floor((x - reach) / cell), int(space.facts[0, FIRST_I]))
    low_j = max(math.floor((y - reach) / cell), int(space.facts[0, FIRST_J]))
    high_i = min(
        math.floor((x + reach) / cell), int(space.facts[0, FIRST_I]) + cells - 1
    )
    high_j = min(
        math.floor((y + reach) / cell), int(space.facts[0, FIRST_J]) + cells - 1
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
