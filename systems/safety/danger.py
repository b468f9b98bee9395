"""Cells and ends of sensor views that a robot has to avoid in one control period."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from systems.framework.compiling import njit
from systems.safety.fine_space import fine_edge
from systems.safety.free_space import FreeSpace, cell_is_free, edge_cells
from systems.safety.outline import frame_at, gaps
from systems.safety.predicted_motion import BrakingNumbers


class Danger(NamedTuple):
    """Non-free cells and ends of sensor views that the robot has to avoid.

    The view of a sensor is the region in which it has seen free floor. The data are
    those of one control period.
    """

    corners: NDArray[np.float64]
    """(m, 2) corners of non-free cells from ``edge_cells``, m."""
    corner_count: int
    """Number of cells in ``corners``."""
    cell_m: float
    distance_m: float
    """Present distance of the lane from the nearest cell in ``corners``, m. It is minus
    infinity if the axle is in a non-free cell.
    """
    arcs: NDArray[np.float64]
    """(sensors, points, 2) points at which the view of each sensor ends, m."""
    ages: NDArray[np.float64]
    """(sensors,) time since the view of each sensor was updated, s."""
    view_distance_m: float
    """Present distance of the axle from the nearest end of a view, m."""


@njit(cache=True)
def nearest_view(
    danger: Danger, x: float, y: float, ahead_s: float, speed: float
) -> float:  # pragma: no cover  (compiled)
    """Computes the distance from a position to the nearest possible obstacle, m.

    The function assumes that an obstacle was at the end of each sensor's view when the
    sensor took its last reading. From then until ``ahead_s`` from now, the obstacle
    approaches the position at ``speed``.
    """
    nearest = np.inf
    for sensor in range(danger.arcs.shape[0]):
        best = np.inf
        for k in range(danger.arcs.shape[1]):
            dx, dy = danger.arcs[sensor, k, 0] - x, danger.arcs[sensor, k, 1] - y
            best = min(best, dx * dx + dy * dy)
        comes = 0.0
        if speed > 0.0:
            comes = speed * (danger.ages[sensor] + ahead_s)
        nearest = min(nearest, math.sqrt(best) - comes)
    return nearest


@njit(cache=True)
def _add_cells_at_body(
    space: FreeSpace,
    frame: Any,
    until: float,
    corners: Any,
    count: int,
    numbers: BrakingNumbers,
) -> int:  # pragma: no cover  (compiled)
    """Adds the non-free cells that the body covers in part or that are next to it.

    These cells may have no free neighbor, so that ``edge_cells`` does not list them.
    """
    cell, reach = space.cell_m, numbers.outline.radius_m + numbers.least_m
    for i in range(
        math.floor((frame.x - reach) / cell), math.ceil((frame.x + reach) / cell)
    ):
        for j in range(
            math.floor((frame.y - reach) / cell), math.ceil((frame.y + reach) / cell)
        ):
            if cell_is_free(space, i, j, until):
                continue
            now = gaps((i * cell, j * cell), cell, frame, numbers.outline)
            if max(now[0], now[1], now[2]) < numbers.least_m:
                corners[count, 0], corners[count, 1] = i * cell, j * cell
                count += 1
    return count


@njit(cache=True)
def danger_of(
    space: FreeSpace, time: float, pose: Any, reach: Any, numbers: BrakingNumbers
) -> Danger:  # pragma: no cover  (compiled)
    """Collects the cells and ends of sensor views that the robot has to avoid.

    Args:
        space: Map of free space.
        time: Current time, s.
        pose: Present pose (x, y, theta), m and rad.
        reach: Two distances, m. The function collects non-free cells within the first
            distance of the axle. A cell is free only if it will still count as free
            after the wheels have rolled the second distance.
        numbers: Model of the robot.

    Returns:
        Cells and ends of views, as input of ``can_be_braked``.
    """
    cell = space.fine.cell_m if len(space.fine.hits) > 0 else space.cell_m
    # The square contains at most this number of cells. Those at the body may count
    # twice.
    corners = np.empty((2 * int(2.0 * reach[0] / cell + 3.0) ** 2, 2))
    until = space.rolled_m[0] + reach[1]
    x, y = pose[0], pose[1]
    distance, frame = np.inf, frame_at(pose, cell)
    if len(space.fine.hits) > 0:
        count = fine_edge(
            space, pose, reach[0], until, numbers.outline, numbers.least_m, corners
        )
    else:
        count = edge_cells(space, x, y, reach[0], until, corners)
        count = _add_cells_at_body(space, frame, until, corners, count, numbers)
    for k in range(count):
        now = gaps(corners[k], cell, frame, numbers.outline)
        distance = min(distance, max(now[0], now[1]))
    i, j = math.floor(x / space.cell_m), math.floor(y / space.cell_m)
    if not cell_is_free(space, i, j, until):
        distance = -np.inf
    ages, view_distance = time - space.ends[:, 5], np.inf
    # Without moving obstacles, the ends of views do not matter.
    moving = numbers.obstacle_speed_m_s > 0.0
    arcs = view_arcs(space, len(space.ends) if moving else 0)
    danger = Danger(corners, count, cell, distance, arcs, ages, np.inf)
    if moving:
        view_distance = nearest_view(danger, x, y, 0.0, 0.0)
    return Danger(corners, count, cell, distance, arcs, ages, view_distance)


@njit(cache=True)
def view_arcs(
    space: FreeSpace, sensors: int
) -> NDArray[np.float64]:  # pragma: no cover  (compiled)
    """Computes points of the arcs at which the views of the first sensors end.

    Args:
        space: Map of free space.
        sensors: Number of sensors.

    Returns:
        (sensors, points, 2) points (x, y), from the right to the left edge of the
        aperture, m.
    """
    points = space.arc_points
    arcs = np.empty((sensors, points, 2))
    for sensor in range(sensors):
        x, y, axis, half_angle, reach, _ = space.ends[sensor]
        for k in range(points):
            angle = axis + half_angle * (2.0 * k / (points - 1) - 1.0)
            arcs[sensor, k, 0] = x + reach * math.cos(angle)
            arcs[sensor, k, 1] = y + reach * math.sin(angle)
    return arcs
