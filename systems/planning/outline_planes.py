"""Half planes of the velocities of P with which the outline of the body stays free."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from systems.framework.compiling import njit
from systems.world.geometry import corners_of, nearest_point_on_rectangle

#: Distance between the outline and obstacles, m (our choice). The lag of the motors
#: uses up to 1 cm of this distance.
_MARGIN_M = 0.02
#: Constant alpha, 1/s (our choice). The outline may approach an obstacle at most at
#: alpha times the remaining distance. With motors that lag by up to 1/(4 alpha), 62 ms,
#: the approach does not overshoot. A smaller alpha turns the body in narrow doors.
_APPROACH_RATE = 4.0
#: Obstacles farther from the outline than this do not count, m.
_REACH_M = 0.5
#: Largest number of half planes; the nearest obstacles count.
_MOST_PLANES = 8


class BodyOutline(NamedTuple):
    """The rectangle of the body, whose middle is the middle of the axle."""

    length_m: float
    width_m: float
    control_point_m: float
    """Distance of P ahead of the axle, m."""


@njit(cache=True)
def outline_gap(
    body: Any, obstacle: Any
) -> tuple[float, float, float, float, float]:  # pragma: no cover  (compiled)
    """Finds the points at which two rectangles are nearest to each other.

    At least one of these points is a corner, unless the rectangles overlap.

    Args:
        body: (6,) rectangle (x, y, theta, length, width, radius), m and rad, without
            round corners.
        obstacle: (6,) rectangle in the same frame.

    Returns:
        Distance, m; point (x, y) of the body; and unit vector (x, y) from the obstacle
        to this point. If the rectangles overlap, the distance is 0, and the unit vector
        points from the middle of the obstacle to the middle of the body.
    """
    away = math.hypot(body[0] - obstacle[0], body[1] - obstacle[1])
    nx, ny = 1.0, 0.0
    if away > 0.0:
        nx, ny = (body[0] - obstacle[0]) / away, (body[1] - obstacle[1]) / away
    best, px, py = np.inf, body[0], body[1]
    boxes = (obstacle[0], obstacle[1], obstacle[2], obstacle[3], obstacle[4])
    corners, others = corners_of(body), corners_of(obstacle)
    for k in range(8):
        if k < 4:
            x, y = corners[k, 0], corners[k, 1]
            dx, dy = nearest_point_on_rectangle((x, y), (*boxes, 0.0))
        else:
            x, y = others[k - 4, 0], others[k - 4, 1]
            box = (body[0], body[1], body[2], body[3], body[4], 0.0)
            bx, by = nearest_point_on_rectangle((x, y), box)
            x, y, dx, dy = x + bx, y + by, -bx, -by
        off = math.hypot(dx, dy)
        if off < best:
            best, px, py = off, x, y
            if off > 0.0:
                nx, ny = -dx / off, -dy / off
    return max(best - obstacle[5], 0.0), px, py, nx, ny


@njit(cache=True)
def outline_planes(
    pose: Any, rectangles: Any, outline: BodyOutline
) -> Any:  # pragma: no cover  (compiled)
    """Lists the velocities of P at which the outline approaches obstacles slowly.

    The point of the outline that is nearest to an obstacle approaches it at most at a
    constant times the remaining distance. The velocity of this point is linear in the
    velocity of the control point P, which determines speed and turn rate of the body.

    Args:
        pose: (x, y, theta) of the body in the world frame W, m and rad.
        rectangles: (k, 6) rectangles of known obstacles (x, y, theta, length, width,
            radius) in W, m and rad.
        outline: Size of the body, and position of P on it.

    Returns:
        (n, 3) half planes in the format of ``nearest_velocity``, of the nearest
        obstacles. An offset is positive if the obstacle is too near.
    """
    x, y, c, s = pose[0], pose[1], math.cos(pose[2]), math.sin(pose[2])
    body = np.array([x, y, pose[2], outline.length_m, outline.width_m, 0.0])
    radius = 0.5 * math.hypot(outline.length_m, outline.width_m)
    planes, gaps, used = np.empty((_MOST_PLANES, 3)), np.empty(_MOST_PLANES), 0
    for k in range(len(rectangles)):
        box = rectangles[k]
        far = radius + 0.5 * (box[3] + box[4]) + box[5] + _REACH_M
        if (box[0] - x) ** 2 + (box[1] - y) ** 2 > far * far:
            continue
        gap, px, py, nx, ny = outline_gap(body, box)
        ahead = nx * c + ny * s
        aside = (ny * (px - x) - nx * (py - y)) / outline.control_point_m
        size = math.hypot(ahead, aside)
        # No motion of the body moves this point toward the obstacle.
        if gap > _REACH_M or size < 1e-6:
            continue
        # With all planes in use, replace the one of the farthest obstacle.
        slot = used
        if used == _MOST_PLANES:
            slot = int(np.argmax(gaps))
            if gap >= gaps[slot]:
                continue
        else:
            used += 1
        gaps[slot] = gap
        planes[slot, 0] = (ahead * c - aside * s) / size
        planes[slot, 1] = (ahead * s + aside * c) / size
        planes[slot, 2] = -_APPROACH_RATE * (gap - _MARGIN_M) / size
    return planes[:used].copy()
