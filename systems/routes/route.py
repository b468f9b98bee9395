"""Finds smooth routes from a start to a goal, past known rectangles and seen discs.

``find_route`` finds a path of grid cells, pulls this path taut, and rounds its corners.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from systems.framework.compiling import njit
from systems.framework.signals import read_only
from systems.routes.clearances import (
    line_clearance,
    place_clearance,
    straight_clearance,
)
from systems.routes.grid_search import search_cells
from systems.routes.occupancy_grid import (
    CELL_M,
    Discs,
    OccupancyGrid,
    cell_middle,
    cell_of,
)

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
#: Least distance between start and goal, m.
SHORTEST_M = 1e-3


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
    found = straight_clearance(a, b, rectangles, discs, clearance, clearance)
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
    least = line_clearance(pulled, rectangles, discs, clearance)
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
        if line_clearance(route, rectangles, discs, clearance) >= least:
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
    if math.hypot(goal[0] - start[0], goal[1] - start[1]) < SHORTEST_M:
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
