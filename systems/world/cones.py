"""Computes the ranges that sensors with cones measure to rectangles.

``systems.world.plane`` defines the rectangles.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from systems.framework.compiling import njit
from systems.world.geometry import beyond, corners_of


@njit(cache=True)
def _nearest_on_segment(
    ax: float, ay: float, bx: float, by: float
) -> float:  # pragma: no cover  (compiled)
    """Returns the distance from the origin to the segment a-b."""
    ex, ey = bx - ax, by - ay
    squared = ex * ex + ey * ey
    t = 0.0 if squared == 0.0 else -(ax * ex + ay * ey) / squared
    t = min(1.0, max(0.0, t))
    return math.hypot(ax + t * ex, ay + t * ey)


@njit(cache=True)
def _range_to_segment(
    ax: float, ay: float, bx: float, by: float, slope: float
) -> float:  # pragma: no cover  (compiled)
    """Returns the distance from the origin to the part of a segment inside a cone.

    The axis of the cone is the x axis, and ``slope`` is the tangent of half of the
    opening angle. The distance is infinite if no part is inside the cone.
    """
    # The part of the segment from low to high is between both sides of the cone.
    low, high = 0.0, 1.0
    for side in (1.0, -1.0):
        ga = slope * ax - side * ay
        gb = slope * bx - side * by
        if ga < 0.0 and gb < 0.0:
            low, high = 1.0, 0.0
        elif ga < 0.0:
            low = max(low, ga / (ga - gb))
        elif gb < 0.0:
            high = min(high, ga / (ga - gb))
    if low > high:
        return np.inf
    ex, ey = bx - ax, by - ay
    return _nearest_on_segment(
        ax + low * ex, ay + low * ey, ax + high * ex, ay + high * ey
    )


@njit(cache=True)
def _range_to_disc(
    x: float, y: float, radius: float, half_angle: float
) -> float:  # pragma: no cover  (compiled)
    """Returns the distance from the origin to the part of a disc inside a cone.

    The axis of the cone is the x axis. If the center (x, y) is outside the cone, the
    nearest point is on the side of the cone that is nearer to the center. The distance
    is infinite if no part is inside the cone.
    """
    squared = x * x + y * y
    if squared <= radius * radius:
        return 0.0
    c, s = math.cos(half_angle), math.sin(half_angle)
    # The center in the axes of this side of the cone.
    ahead, off = c * x + s * abs(y), c * abs(y) - s * x
    if ahead <= 0.0:
        return np.inf
    if off <= 0.0:
        return math.sqrt(squared) - radius
    if off > radius:
        return np.inf
    return ahead - math.sqrt(radius * radius - off * off)


@njit(cache=True)
def _covers(
    rectangle: NDArray[np.float64], px: float, py: float
) -> bool:  # pragma: no cover  (compiled)
    """Returns whether a rectangle contains a point."""
    x, y, theta, length, width, radius = rectangle
    c, s = math.cos(theta), math.sin(theta)
    u = beyond(c * (px - x) + s * (py - y), length / 2.0)
    v = beyond(c * (py - y) - s * (px - x), width / 2.0)
    return u * u + v * v <= radius * radius


@njit(cache=True)
def cone_range(
    x: float, y: float, axis: float, half_angle: float, rectangles: NDArray[np.float64]
) -> float:  # pragma: no cover  (compiled)
    """Computes the distance from a sensor to the nearest surface inside its cone.

    The function cuts each edge of each rectangle to the part inside the cone. Then it
    computes the exact distance from the sensor to this part. The range is the smallest
    of these distances. A hidden surface is never the nearest, so the function does not
    check whether surfaces are hidden. The outline of a rectangle with a radius consists
    of edges, which are moved outward by the radius, and of four discs at the corners.

    Args:
        x: First coordinate of the sensor, m.
        y: Second coordinate of the sensor, m.
        axis: Direction of the axis of the cone, rad.
        half_angle: Half of the opening angle, rad, below pi/2.
        rectangles: (n, 6) rectangles (x, y, theta, length, width, radius) in the same
            frame, m and rad.

    Returns:
        Range, m. It is 0 if the sensor is inside a rectangle. It is infinite if no
        surface is inside the cone.
    """
    best = np.inf
    ca, sa = math.cos(axis), math.sin(axis)
    slope = math.tan(half_angle)
    for k in range(rectangles.shape[0]):
        length, width, radius = rectangles[k, 3], rectangles[k, 4], rectangles[k, 5]
        # A line segment has one edge and no inside.
        flat = length == 0.0 or width == 0.0
        inside = not flat
        corners = corners_of(rectangles[k])
        for i in range(4):
            j = (i + 1) % 4
            dx, dy = corners[i, 0] - x, corners[i, 1] - y
            fx, fy = corners[j, 0] - x, corners[j, 1] - y
            # The sensor is inside the rectangle if it is to the left of all edges.
            if dx * fy - dy * fx < 0.0:
                inside = False
            ax, ay = ca * dx + sa * dy, -sa * dx + ca * dy
            bx, by = ca * fx + sa * fy, -sa * fx + ca * fy
            if radius > 0.0:
                along = length if i % 2 == 0 else width
                if along > 0.0 or i == 0:
                    best = min(best, _range_to_disc(ax, ay, radius, half_angle))
                if along == 0.0:
                    continue
                # Move the edge to the right of its direction, which is outward.
                out_x, out_y = radius * (by - ay) / along, radius * (ax - bx) / along
                ax, ay, bx, by = ax + out_x, ay + out_y, bx + out_x, by + out_y
            elif flat and i > (1 if length == 0.0 else 0):
                break
            best = min(best, _range_to_segment(ax, ay, bx, by, slope))
        if inside or (radius > 0.0 and _covers(rectangles[k], x, y)):
            best = 0.0
    return best


@njit(cache=True)
def fan_ranges(
    pose_WB: NDArray[np.float64],
    rectangles: NDArray[np.float64],
    axes: NDArray[np.float64],
    places: NDArray[np.float64],
    half_angles: NDArray[np.float64],
    control_point_m: float,
) -> NDArray[np.float64]:  # pragma: no cover  (compiled)
    """Computes the range of each range sensor of a body with ``cone_range``.

    Args:
        pose_WB: (3,) x, y, theta of the body frame B in the world frame W, m and rad.
        rectangles: (m, 6) rectangles (x, y, theta, length, width, radius) in W, m and
            rad.
        axes: (n,) directions of the axes of the cones in B, rad.
        places: (n, 2) positions of the sensors relative to the control point P, in the
            axes of B, m.
        half_angles: (n,) halves of the opening angles, rad.
        control_point_m: Distance of P ahead of the origin of B, m.

    Returns:
        (n,) ranges, m. A range is infinite if no surface is inside the cone.
    """
    x, y, theta = pose_WB
    c, s = math.cos(theta), math.sin(theta)
    ranges = np.empty(axes.size)
    for k in range(axes.size):
        ahead, left = control_point_m + places[k, 0], places[k, 1]
        ranges[k] = cone_range(
            x + c * ahead - s * left,
            y + s * ahead + c * left,
            theta + axes[k],
            half_angles[k],
            rectangles,
        )
    return ranges
