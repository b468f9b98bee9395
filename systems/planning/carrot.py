"""Where to head on a way: its farthest point that is worth driving to straight."""

from __future__ import annotations

import math

from systems.framework.compiling import njit
from systems.planning.way import STRAIGHT, Way

#: The straight line may cost so much more than the way, which zigzags on its cells.
_DEARER = 1.1
#: Nearer points need not be worth it: a robot stands beside the middle of its cell, m.
_NEAREST_M = 0.4


@njit(cache=True)
def find_carrot(
    way: Way, x: float, y: float, farthest_m: float
) -> tuple[float, float]:  # pragma: no cover  (compiled)
    """The farthest point of a way to which the straight line costs no more.

    Args:
        way: From ``find_way``.
        x: Where the robot is, m.
        y: See x.
        farthest_m: No point farther away is looked at, m.

    Returns:
        (x, y) m; the robot's own place where there is no way.
    """
    found, begin, cell = (x, y), 0, way.facts[0, 5]
    for k in range(int(way.facts[0, 0])):
        px, py = way.path[k, 0], way.path[k, 1]
        i, j = _cell(way, px, py)
        distance = math.hypot(px - x, py - y)
        if k == 0:
            begin = way.cost[i, j]
        elif distance > farthest_m:
            break
        steps, price = max(1, math.ceil(2.0 * distance / cell)), 0.0
        for step in range(steps):
            part = (step + 0.5) / steps
            a, b = _cell(way, x + (px - x) * part, y + (py - y) * part)
            price += way.price[a, b] / steps
        straight = STRAIGHT * price * distance / cell
        if straight <= _DEARER * (begin - way.cost[i, j]) or distance < _NEAREST_M:
            found = px, py
    return found


@njit(cache=True)
def _cell(
    way: Way, x: float, y: float
) -> tuple[int, int]:  # pragma: no cover  (compiled)
    """Number of the cell of a place, the nearest one of a place beyond all cells."""
    size, cell = way.price.shape[0], way.facts[0, 5]
    i = math.floor(x / cell) - int(way.facts[0, 3])
    j = math.floor(y / cell) - int(way.facts[0, 4])
    return min(max(i, 0), size - 1), min(max(j, 0), size - 1)
