"""Finds smooth routes from a start to a goal, past known rectangles and seen discs.

``find_route`` finds a path of grid cells, pulls this path taut, and rounds its corners.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from systems.framework.compiling import njit
from systems.framework.input_error import InputError
from systems.framework.signals import read_only
from systems.routes.grid_search import search_cells
from systems.routes.occupancy_grid import (
    CELL_M,
    Discs,
    OccupancyGrid,
    block_discs,
    block_rectangles,
    cell_middle,
    cell_of,
    free_grid,
    sorted_discs,
)
from systems.world.geometry import beyond_rectangle, segment_clearance

#: Largest number of points of a route.
ROUTE_POINTS = 1_000
#: A route has at most ``_USUAL_POINTS`` points, or more if these points would be more
#: than ``_WIDEST_M``, m, apart.
_USUAL_POINTS, _WIDEST_M = 200, 0.1
#: Number of values of the port ``route``: the number of points, the spacing of the
#: points, and x and y of each point.
ROUTE_SIZE = 2 + 2 * ROUTE_POINTS
#: Units of the values of the port ``route``.
ROUTE_UNIT = "number of points, then in m their spacing, and x and y of each"

#: Spacing of the points of a taut path when it is rounded, m.
_FINE_M = 0.01
#: Half widths of the window of the moving averages, in fine points. The planner tries
#: them in this order until the route keeps enough distance from obstacles.
_HALF_WINDOWS = (15, 10, 7, 5, 3, 2, 1, 0)
#: Number of successive averages. After two averages, the curvature is continuous.
_AVERAGES = 2
#: Rounding may bring a route nearer to obstacles, by at most ``_ROUNDING_M``, m, and by
#: at most ``_ROUNDING_SHARE`` times the clearance.
_ROUNDING_M, _ROUNDING_SHARE = 0.015, 0.05
#: A segment from the start or to the goal may come nearer to obstacles than this end,
#: by at most ``_WAY_OUT_M``, m, and by at most ``_WAY_OUT_SHARE`` times the clearance.
#: Both shares and the 3 % of ``CELL_M`` leave at least 92 % of the clearance.
_WAY_OUT_M, _WAY_OUT_SHARE = 0.01, 0.03
#: A goal may be nearer to obstacles than the clearance by this rounding error, m.
_GRAZE_M = 1e-9
#: Number of steps from the desired clearance to the least clearance.
_NARROWINGS = 5
#: Least distance between start and goal, m.
_SHORTEST_M = 1e-3


@njit(cache=True)
def _length(points: Any) -> float:  # pragma: no cover  (compiled)
    """Return the length of a line through points, m."""
    length = 0.0
    for k in range(1, len(points)):
        dx, dy = points[k, 0] - points[k - 1, 0], points[k, 1] - points[k - 1, 1]
        length += math.hypot(dx, dy)
    return length


@dataclass(frozen=True)
class Route:
    """Points with equal spacing along a smooth line; the last one is the goal."""

    points: NDArray[np.float64]
    """(n, 2) in W, m; read-only."""

    def __post_init__(self) -> None:
        read_only(self.points)

    @property
    def spacing_m(self) -> float:
        """Distance between two points along the line, m."""
        return self.length_m / (len(self.points) - 1)

    @property
    def length_m(self) -> float:
        """Length from the first point to the last, m."""
        return float(_length(self.points))

    @property
    def numbers(self) -> NDArray[np.float64]:
        """(ROUTE_SIZE,) value of the port ``route``."""
        numbers: NDArray[np.float64] = np.zeros(ROUTE_SIZE)
        fill_route(numbers, self.points)
        return numbers


@njit(cache=True)
def fill_route(numbers: Any, points: Any) -> None:  # pragma: no cover  (compiled)
    """Writes a route in the format of the port ``route``.

    Args:
        numbers: (ROUTE_SIZE,) array that receives the route, modified in place.
        points: (n, 2) points of the route with equal spacing in the world frame W, m.
    """
    for k in range(ROUTE_SIZE):
        numbers[k] = 0.0
    for k in range(len(points)):
        numbers[2 + 2 * k], numbers[3 + 2 * k] = points[k, 0], points[k, 1]
    numbers[0], numbers[1] = len(points), _length(points) / (len(points) - 1)


@njit(cache=True)
def _first_from(rows: Any, x: float) -> int:  # pragma: no cover  (compiled)
    """Returns the index of the first of sorted discs with a middle from ``x`` on."""
    low, high = 0, len(rows)
    while low < high:
        middle = (low + high) // 2
        if rows[middle, 0] < x:
            low = middle + 1
        else:
            high = middle
    return low


@njit(cache=True)
def _clearance(
    a: Any, b: Any, rectangles: Any, discs: Discs, least: float, most: float
) -> float:  # pragma: no cover  (compiled)
    """Returns the distance of a segment from the nearest obstacle, at most ``most``.

    At the first obstacle nearer than ``least``, the function stops and returns the
    distance of this obstacle.
    """
    best = most
    dx, dy = b[0] - a[0], b[1] - a[1]
    squared = max(dx * dx + dy * dy, 1e-18)
    low_x, high_x = min(dx, 0.0), max(dx, 0.0)
    low_y, high_y = min(dy, 0.0), max(dy, 0.0)
    farthest = max(best + discs.largest, 0.0)
    rows = discs.rows
    for k in range(_first_from(rows, a[0] + low_x - farthest), len(rows)):
        x, y = rows[k, 0] - a[0], rows[k, 1] - a[1]
        if x > high_x + farthest:
            break
        reach = max(best + rows[k, 2], 0.0)
        # Most of the discs are outside the rectangle around the segment.
        if x < low_x - reach or x > high_x + reach:
            continue
        if y < low_y - reach or y > high_y + reach:
            continue
        part = min(max((x * dx + y * dy) / squared, 0.0), 1.0)
        x, y = x - part * dx, y - part * dy
        if x * x + y * y < reach * reach:
            best = math.hypot(x, y) - rows[k, 2]
            if best < least:
                return best
            farthest = max(best + discs.largest, 0.0)
    for k in range(len(rectangles)):
        box = rectangles[k]
        # Skip the exact distance if the circles around segment and obstacle are far
        # apart.
        x, y = box[0] - a[0] - 0.5 * dx, box[1] - a[1] - 0.5 * dy
        reach = 0.5 * (math.hypot(box[3], box[4]) + math.sqrt(squared))
        reach += box[5] + max(best, 0.0)
        if x * x + y * y < reach * reach:
            best = min(best, segment_clearance(a, b, box))
            if best < least:
                return best
    return best


@njit(cache=True)
def place_clearance(
    x: float, y: float, rectangles: Any, discs: Discs
) -> float:  # pragma: no cover  (compiled)
    """Computes the distance of a point from the nearest obstacle.

    Args:
        x: x coordinate of the point in the world frame W, m.
        y: y coordinate of the point in W, m.
        rectangles: (k, 6) rectangles of obstacles (x, y, theta, length, width,
            radius) in W, m and rad.
        discs: Further obstacles.

    Returns:
        Distance, m. It is 0 inside a rectangle, negative inside a disc, and infinite
        without obstacles.
    """
    best = np.inf
    for k in range(len(rectangles)):
        du, dv = beyond_rectangle((x, y), rectangles[k])
        best = min(best, math.hypot(du, dv))
    for disc in discs.rows:
        off = math.hypot(disc[0] - x, disc[1] - y)
        best = min(best, off - disc[2])
    return best


@njit(cache=True)
def _line_clearance(
    points: Any, rectangles: Any, discs: Discs, most: float
) -> float:  # pragma: no cover  (compiled)
    """Return the distance of a line from the nearest obstacle, limited to ``most``."""
    best = most
    for k in range(len(points) - 1):
        a, b = points[k], points[k + 1]
        best = min(best, _clearance(a, b, rectangles, discs, -np.inf, best))
    return best


@njit(cache=True)
def _spaced(points: Any, count: int) -> Any:  # pragma: no cover  (compiled)
    """Return ``count`` points with equal spacing along a line, including its ends."""
    lengths = np.zeros(len(points))
    for k in range(1, len(points)):
        dx, dy = points[k, 0] - points[k - 1, 0], points[k, 1] - points[k - 1, 1]
        lengths[k] = lengths[k - 1] + math.hypot(dx, dy)
    out, k = np.empty((count, 2)), 1
    for i in range(count):
        at = lengths[-1] * i / (count - 1)
        while k < len(points) - 1 and lengths[k] < at:
            k += 1
        part = (at - lengths[k - 1]) / max(lengths[k] - lengths[k - 1], 1e-12)
        part = min(max(part, 0.0), 1.0)
        for axis in range(2):
            first, second = points[k - 1, axis], points[k, axis]
            out[i, axis] = first + part * (second - first)
    for axis in range(2):
        out[0, axis], out[-1, axis] = points[0, axis], points[-1, axis]
    return out


@njit(cache=True)
def _sees(
    a: Any, b: Any, rectangles: Any, discs: Discs, clearance: float
) -> bool:  # pragma: no cover  (compiled)
    """Return whether all points of a segment keep a clearance from obstacles."""
    found = _clearance(a, b, rectangles, discs, clearance, clearance)
    return bool(found >= clearance)


@njit(cache=True)
def _pulled(
    points: Any, rectangles: Any, discs: Discs, clearance: float
) -> Any:  # pragma: no cover  (compiled)
    """Removes points of a path so that the remaining path is taut.

    From each kept point, the function goes along the path until it finds a point out of
    sight, and keeps the point before it. A point is in sight if the straight segment to
    it keeps the clearance. The next point always counts as in sight.
    """
    kept = np.empty_like(points)
    kept[0] = points[0]
    count, at = 1, 0
    while at < len(points) - 1:
        to = at + 1
        while to + 1 < len(points) and _sees(
            points[at], points[to + 1], rectangles, discs, clearance
        ):
            to += 1
        kept[count] = points[to]
        count += 1
        at = to
    return kept[:count].copy()


@njit(cache=True)
def _averaged(points: Any, half: int) -> Any:  # pragma: no cover  (compiled)
    """Returns the moving average of the points of a path.

    The window becomes shorter toward the ends of the path, so that the end points do
    not move.
    """
    out = np.empty_like(points)
    for k in range(len(points)):
        h = min(half, k, len(points) - 1 - k)
        for axis in range(2):
            added = 0.0
            for j in range(k - h, k + h + 1):
                added += points[j, axis]
            out[k, axis] = added / (2 * h + 1)
    return out


@njit(cache=True)
def _rounded(
    pulled: Any, rectangles: Any, discs: Discs, clearance: float
) -> Any:  # pragma: no cover  (compiled)
    """Rounds the corners of a taut path as far as the clearance permits.

    The function applies moving averages to closely spaced points of the path. It tries
    the widest window first, then narrower windows, and finally none. It accepts the
    first route that keeps the clearance of the taut path, minus a small allowance.
    """
    count = max(math.ceil(_length(pulled) / _FINE_M), 1) + 1
    fine = _spaced(pulled, count)
    least = _line_clearance(pulled, rectangles, discs, clearance)
    # An end may be much nearer to an obstacle than the clearance: limit the allowance
    # to half of the distance there.
    least -= min(_ROUNDING_M, _ROUNDING_SHARE * clearance, 0.5 * least)
    route = pulled
    for half in _HALF_WINDOWS:
        line = fine
        for _ in range(_AVERAGES):
            line = _averaged(line, half)
        most = max(_USUAL_POINTS, math.ceil(_length(line) / _WIDEST_M) + 1)
        route = _spaced(line, min(count, most, ROUTE_POINTS))
        if _line_clearance(route, rectangles, discs, clearance) >= least:
            break
    return route


@njit(cache=True)
def _way_out(
    grid: OccupancyGrid,
    end: tuple[float, float],
    rectangles: Any,
    discs: Discs,
    clearance: float,
) -> tuple[int, int]:  # pragma: no cover  (compiled)
    """Returns the nearest free grid cell that a safe straight segment joins to ``end``.

    ``end`` is the start or the goal of a route. A safe segment keeps the clearance,
    minus a small allowance. If ``end`` itself is nearer to an obstacle than the
    clearance, the segment has to keep only the distance of ``end`` from this obstacle,
    minus the allowance.

    Returns:
        (i, j), indices of the cell along x and y. They are (-1, -1) if there is no such
        cell within about two clearances.
    """
    here = place_clearance(end[0], end[1], rectangles, discs)
    least = min(here, clearance)
    least -= min(_WAY_OUT_M, _WAY_OUT_SHARE * clearance, 0.5 * least)
    i, j = cell_of(grid, end[0], end[1])
    found, best = (-1, -1), np.inf
    if i < 0 or here <= 0.0:
        return found
    reach = math.ceil(2.0 * clearance / CELL_M)
    n, m = grid.blocked.shape
    for a in range(max(i - reach, 0), min(i + reach + 1, n)):
        for b in range(max(j - reach, 0), min(j + reach + 1, m)):
            if grid.blocked[a, b]:
                continue
            middle = cell_middle(grid, a, b)
            away = math.hypot(middle[0] - end[0], middle[1] - end[1])
            if away < best and _sees(end, middle, rectangles, discs, least):
                found, best = (a, b), away
    return found


@njit(cache=True)
def find_route(
    grid: OccupancyGrid,
    start: tuple[float, float],
    goal: tuple[float, float],
    rectangles: Any,
    discs: Discs,
    clearance: float,
) -> Any:  # pragma: no cover  (compiled)
    """Finds a smooth route from a start to a goal. Compiled code can call the function.

    The function works in these steps:

    1. It joins the start and the goal to free grid cells by straight segments. If an
       end is nearer to an obstacle than the clearance, its segment comes only slightly
       nearer.
    2. A* finds a path of cells between the two free cells.
    3. The function pulls this path taut and rounds its corners.

    Args:
        grid: Grid in which the cells nearer to obstacles than the clearance are
            blocked.
        start: (x, y) in the world frame W, m.
        goal: (x, y) in W, m.
        rectangles: (k, 6) rectangles of obstacles (x, y, theta, length, width,
            radius) in W, m and rad.
        discs: Further obstacles.
        clearance: Distance that the route keeps from obstacles, m.

    Returns:
        (p, 2) points with equal spacing from start to goal in W, m, at most
        ``ROUTE_POINTS``. The array is empty if there is no route.
    """
    none = np.empty((0, 2))
    if math.hypot(goal[0] - start[0], goal[1] - start[1]) < _SHORTEST_M:
        return none
    first = _way_out(grid, start, rectangles, discs, clearance)
    last = _way_out(grid, goal, rectangles, discs, clearance)
    if first[0] < 0 or last[0] < 0:
        return none
    cells = search_cells(grid.blocked, first, last)
    if len(cells) == 0:
        return none
    points = np.empty((len(cells) + 2, 2))
    for k in range(len(cells)):
        x, y = cell_middle(grid, cells[k, 0], cells[k, 1])
        points[k + 1, 0], points[k + 1, 1] = x, y
    for axis in range(2):
        points[0, axis], points[-1, axis] = start[axis], goal[axis]
    # Pull the path taut from each end: the second pass makes corners tauter.
    pulled = _pulled(points, rectangles, discs, clearance)
    count = max(math.ceil(_length(pulled) / CELL_M), 1) + 1
    back = np.ascontiguousarray(_with_corners(pulled, count)[::-1])
    pulled = np.ascontiguousarray(_pulled(back, rectangles, discs, clearance)[::-1])
    return _rounded(pulled, rectangles, discs, clearance)


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


@njit(cache=True)
def fill_clearances(
    clearances: Any, points: Any, rectangles: Any, discs: Discs
) -> None:  # pragma: no cover  (compiled)
    """Computes the distance of each point of a route from the nearest obstacle.

    Args:
        clearances: (ROUTE_POINTS,) array that receives the distances, m.
        points: (n, 2) points of the route in the world frame W, m.
        rectangles: (k, 6) rectangles of obstacles (x, y, theta, length, width,
            radius) in W, m and rad.
        discs: Further obstacles.
    """
    for k in range(len(points)):
        clearances[k] = _clearance(
            points[k], points[k], rectangles, discs, -np.inf, np.inf
        )


@njit(cache=True)
def _with_corners(points: Any, count: int) -> Any:  # pragma: no cover  (compiled)
    """Return points along a polyline, including the vertices of the polyline."""
    out = np.empty((count + 2 * len(points), 2))
    step, used = _length(points) / (count - 1), 0
    for k in range(len(points) - 1):
        dx, dy = points[k + 1, 0] - points[k, 0], points[k + 1, 1] - points[k, 1]
        parts = max(math.ceil(math.hypot(dx, dy) / step - 1e-9), 1)
        for part in range(parts):
            out[used, 0] = points[k, 0] + dx * part / parts
            out[used, 1] = points[k, 1] + dy * part / parts
            used += 1
    out[used] = points[-1]
    return out[: used + 1]


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
    if math.dist(start, goal) < _SHORTEST_M:
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
