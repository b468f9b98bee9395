"""Routes with the widest clearance that is possible, up to the desired one."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from systems.framework.compiling import njit
from systems.framework.input_error import InputError
from systems.routes.clearances import place_clearance
from systems.routes.occupancy_grid import (
    Discs,
    OccupancyGrid,
    block_discs,
    block_rectangles,
    free_grid,
    sorted_discs,
)
from systems.routes.route import SHORTEST_M, Route, find_route

#: A goal may be nearer to obstacles than the clearance by this rounding error, m.
_GRAZE_M = 1e-9
#: Number of steps from the desired clearance to the least clearance.
_NARROWINGS = 5


def clearances_to_try(clearance_m: float, least_m: float) -> NDArray[np.float64]:
    """Returns clearances from the desired to the least, in the order of the attempts.

    Args:
        clearance_m: Desired clearance, m.
        least_m: Least clearance, m. From ``clearance_m`` on, only that one counts.

    Returns:
        (n,) clearances, m, descending.
    """
    if least_m >= clearance_m:
        return np.array([clearance_m])
    return np.linspace(clearance_m, least_m, _NARROWINGS + 1)


@njit(cache=True)
def find_widest_route(
    free: OccupancyGrid,
    start: tuple[float, float],
    goal: tuple[float, float],
    rectangles: Any,
    discs: Discs,
    clearances: Any,
    seen_m: float,
) -> Any:  # pragma: no cover  (compiled)
    """Finds a route with the first of several clearances that permits one.

    Args:
        free: Grid without blocked cells. It covers start, goal and obstacles.
        start: (x, y) in the world frame W, m.
        goal: (x, y) in W, m.
        rectangles: (k, 6) rectangles of obstacles (x, y, theta, length, width,
            radius) in W, m and rad.
        discs: Further obstacles.
        clearances: (c,) clearances to try, m.
        seen_m: Least distance of the route from the discs, m.

    Returns:
        (p, 2) points in W, m, see ``find_route``. The array is empty if there is no
        route.
    """
    points = np.empty((0, 2))
    for clearance in clearances:
        grid = OccupancyGrid(free.blocked.copy(), free.low)
        rows, more = discs.rows.copy(), max(seen_m - clearance, 0.0)
        rows[:, 2] += more
        grown = Discs(rows, discs.largest + more)
        block_rectangles(grid, rectangles, clearance)
        block_discs(grid, grown, clearance)
        points = find_route(grid, start, goal, rectangles, grown, clearance)
        if len(points) > 0:
            break
    return points


def plan_route(
    start: tuple[float, float],
    goal: tuple[float, float],
    rectangles: ArrayLike,
    *,
    clearance_m: float = 0.35,
    least_m: float = np.inf,
) -> Route:
    """Plans a short and smooth route for the center of a disc-shaped robot.

    The function works in these steps:

    1. A* searches a grid. The middles of the free cells keep the clearance.
    2. The function pulls the path of cells taut. The straight segments keep the
       clearance, too.
    3. Two moving averages over 0.3 m round the path. If this reduces the distance from
       an obstacle by more than 15 mm or 5 % of the clearance, the averages become
       shorter.

    The route keeps at least 92 % of the clearance from all known obstacles. A route
    longer than 150 m may come nearer at sharp corners, because its ``ROUTE_POINTS``
    points are then too far apart.

    If no route has the desired clearance, the function plans with less, in
    ``_NARROWINGS`` equal steps down to ``least_m``.

    Args:
        start: (x, y) in the world frame W, m. If the start is nearer to an obstacle
            than the clearance, the route first leads away from this obstacle.
        goal: (x, y) in W, m.
        rectangles: (k, 6) rectangles of known obstacles (x, y, theta, length, width,
            radius) in W, m and rad.
        clearance_m: Desired distance from known obstacles, m.
        least_m: Least permitted distance from known obstacles, m. From ``clearance_m``
            on, every route has the desired clearance.

    Returns:
        The route.

    Raises:
        InputError: Start or goal lies in an obstacle.
        InputError: The goal is too near to an obstacle or to the start.
        InputError: There is no route, or the grid would have too many cells.

    Reference: Engelbrecht, Steyn and Djouani (2021) name A* in sec. 2, but describe no
    grid. Hart, Nilsson and Raphael (1968) describe A*.
    """
    known: NDArray[np.float64] = np.array(rectangles, dtype=float).reshape(-1, 6)
    discs = sorted_discs(np.empty((0, 3)))
    # Integers would trigger a new compilation.
    start = float(start[0]), float(start[1])
    goal = float(goal[0]), float(goal[1])
    off = place_clearance(*goal, known, discs)
    clearances = clearances_to_try(clearance_m, least_m)
    least_m = float(clearances[-1])
    lower = "lower clearance_m" if least_m == clearance_m else "take a narrower robot"
    if off < least_m - _GRAZE_M:
        raise InputError(
            "goal_m",
            f"{_text(goal)} lies {_where(off)}, and the route needs {least_m:.3g} m; "
            f"move it, or {lower}",
        )
    if place_clearance(*start, known, discs) <= 0.0:
        raise InputError(
            "start",
            f"P starts at {_text(start)}, in a known obstacle; move P or the obstacle",
        )
    if math.dist(start, goal) < SHORTEST_M:
        raise InputError("goal_m", f"{_text(goal)} is where P starts; move it")
    grid = free_grid([start, goal], known)
    points = find_widest_route(grid, start, goal, known, discs, clearances, 0.0)
    if not len(points):
        raise InputError(
            "goal_m",
            f"no route leads from {_text(start)} to {_text(goal)} at "
            f"{least_m:.3g} m from the known obstacles; move start or goal, or {lower}",
        )
    return Route(points)


def _text(place: tuple[float, float]) -> str:
    return f"({place[0]:g}, {place[1]:g})"


def _where(off: float) -> str:
    near = f"{off:.3g} m from a known obstacle"
    return near if off > 0.0 else "in a known obstacle"
