"""Choice of the carrot: the point of the route to which the robot drives straight."""

from __future__ import annotations

import math

from systems.framework.compiling import njit
from systems.planning.way import STRAIGHT, Way, cell_at

#: A straight line is accepted if it costs at most this multiple of the cost of the
#: route to the same point.
_DEARER = 1.1
#: Points within this distance, m, are always accepted. Near the robot, the comparison
#: of costs is inexact, because the robot may be beside the middle of its cell.
_NEAREST_M = 0.4


@njit(cache=True)
def find_carrot(
    way: Way, x: float, y: float, farthest_m: float
) -> tuple[float, float]:  # pragma: no cover  (compiled)
    """Finds the point of a route toward which the robot may drive straight.

    A straight line to the point may cost at most 10 % more than the route to the same
    point. The function chooses the farthest point of the route that satisfies this
    condition. The cost of a line is its length times the mean price of the cells under
    it.

    Args:
        way: Route from ``find_way``.
        x: Position of the robot, x in the world frame W, m.
        y: Position of the robot, y in W, m.
        farthest_m: Distance from the robot, m. The search ends at the first point of
            the route beyond this distance.

    Returns:
        Position (x, y) of the point, m. If there is no route, the function returns the
        position of the robot.
    """
    found, begin, cell = (x, y), 0, way.cell_m[0]
    for k in range(way.points[0]):
        px, py = way.path[k, 0], way.path[k, 1]
        i, j = cell_at(way, px, py)
        distance = math.hypot(px - x, py - y)
        if k == 0:
            begin = way.cost[i, j]
        elif distance > farthest_m:
            break
        # Mean price at points half a cell apart.
        steps, price = max(1, math.ceil(2.0 * distance / cell)), 0.0
        for step in range(steps):
            part = (step + 0.5) / steps
            a, b = cell_at(way, x + (px - x) * part, y + (py - y) * part)
            price += way.price[a, b] / steps
        straight = STRAIGHT * price * distance / cell
        if straight <= _DEARER * (begin - way.cost[i, j]) or distance < _NEAREST_M:
            found = px, py
    return found
