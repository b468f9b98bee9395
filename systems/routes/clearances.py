"""Distances of points, segments and lines from known rectangles and seen discs."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from systems.framework.compiling import njit
from systems.routes.occupancy_grid import Discs
from systems.world.geometry import beyond_rectangle, segment_clearance


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
def straight_clearance(
    a: Any, b: Any, rectangles: Any, discs: Discs, least: float, most: float
) -> float:  # pragma: no cover  (compiled)
    """Computes the distance of a segment from the nearest obstacle.

    Args:
        a: (x, y) of one end in the world frame W, m.
        b: (x, y) of the other end in W, m.
        rectangles: (k, 6) rectangles of obstacles (x, y, theta, length, width,
            radius) in W, m and rad.
        discs: Further obstacles.
        least: At the first obstacle nearer than this distance, m, the function stops
            and returns the distance of this obstacle.
        most: Greatest result, m.

    Returns:
        Distance, m.
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
def line_clearance(
    points: Any, rectangles: Any, discs: Discs, most: float
) -> float:  # pragma: no cover  (compiled)
    """Computes the distance of a line through points from the nearest obstacle.

    Args:
        points: (n, 2) points in the world frame W, m.
        rectangles: (k, 6) rectangles of obstacles (x, y, theta, length, width,
            radius) in W, m and rad.
        discs: Further obstacles.
        most: Greatest result, m.

    Returns:
        Distance, m.
    """
    best = most
    for k in range(len(points) - 1):
        a, b = points[k], points[k + 1]
        best = min(best, straight_clearance(a, b, rectangles, discs, -np.inf, best))
    return best


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
        clearances[k] = straight_clearance(
            points[k], points[k], rectangles, discs, -np.inf, np.inf
        )
