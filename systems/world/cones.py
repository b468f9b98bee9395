"""Computes the ranges that sensors with cones measure to rectangles.

``systems.world.plane`` defines the rectangles.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from systems.framework.compiling import njit
from systems.world.geometry import beyond, fill_corners

#: Margin of lengths, m, and of angles, rad, that exceeds all rounding errors.
_MARGIN = 1e-6
#: Ratio of squared distances that exceeds all rounding errors.
_FARTHER = 1.0 + 1e-9


@njit(cache=True, error_model="numpy")
def _range_to_segment(
    ax: float, ay: float, bx: float, by: float, slope: float, best: float
) -> float:  # pragma: no cover  (compiled)
    """Returns the distance from the origin to the part of a segment inside a cone.

    The axis of the cone is the x axis, and ``slope`` is the tangent of half of the
    opening angle. The result is ``best`` if no part is inside the cone, or if the
    distance is larger than ``best``.
    """
    # The part of the segment from low to high is between both sides of the cone.
    low, high = 0.0, 1.0
    for side in (1.0, -1.0):
        ga = slope * ax - side * ay
        gb = slope * bx - side * by
        if ga < 0.0 and gb < 0.0:
            return best
        if ga < 0.0:
            low = max(low, ga / (ga - gb))
        elif gb < 0.0:
            high = min(high, ga / (ga - gb))
    if low > high:
        return best
    ex, ey = bx - ax, by - ay
    ax, ay, bx, by = ax + low * ex, ay + low * ey, ax + high * ex, ay + high * ey
    # The point of this part that is nearest to the origin.
    ex, ey = bx - ax, by - ay
    squared = ex * ex + ey * ey
    t = 0.0 if squared == 0.0 else -(ax * ex + ay * ey) / squared
    t = min(1.0, max(0.0, t))
    x, y = ax + t * ex, ay + t * ey
    # ``hypot`` takes long, and most parts are behind others.
    if x * x + y * y > _FARTHER * best * best:
        return best
    return min(best, math.hypot(x, y))


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


@register_jitable
def _range_to_rectangle(
    corners: NDArray[np.float64],
    rectangle: NDArray[np.float64],
    cosine: float,
    sine: float,
    slope: float,
    half_angle: float,
    best: float,
) -> float:  # pragma: no cover  (compiled)
    """Returns the distance from a sensor to the outline of a rectangle in its cone.

    ``corners`` are relative to the sensor. ``cosine`` and ``sine`` give the direction
    of the axis of the cone. The result is ``best`` if it is smaller.
    """
    length, width, radius = rectangle[3], rectangle[4], rectangle[5]
    # A line segment has one edge.
    edges = 4
    if radius == 0.0 and (length == 0.0 or width == 0.0):
        edges = 2 if length == 0.0 else 1
    dx, dy = corners[0, 0], corners[0, 1]
    bx, by = cosine * dx + sine * dy, -sine * dx + cosine * dy
    for i in range(edges):
        j = (i + 1) % 4
        dx, dy = corners[j, 0], corners[j, 1]
        ax, ay = bx, by
        bx, by = cosine * dx + sine * dy, -sine * dx + cosine * dy
        if radius == 0.0:
            best = _range_to_segment(ax, ay, bx, by, slope, best)
            continue
        along = length if i % 2 == 0 else width
        if along > 0.0 or i == 0:
            best = min(best, _range_to_disc(ax, ay, radius, half_angle))
        if along > 0.0:
            # Move the edge to the right of its direction, which is outward.
            out_x, out_y = radius * (by - ay) / along, radius * (ax - bx) / along
            best = _range_to_segment(
                ax + out_x, ay + out_y, bx + out_x, by + out_y, slope, best
            )
    return best


@register_jitable
def _is_inside(
    corners: NDArray[np.float64], rectangle: NDArray[np.float64], x: float, y: float
) -> bool:  # pragma: no cover  (compiled)
    """Returns whether a sensor at (x, y) is inside a rectangle.

    ``corners`` are relative to the sensor.
    """
    if rectangle[5] > 0.0 and _covers(rectangle, x, y):
        return True
    # A line segment has no inside.
    if rectangle[3] == 0.0 or rectangle[4] == 0.0:
        return False
    # The sensor is inside the rectangle if it is to the left of all edges.
    for i in range(4):
        j = (i + 1) % 4
        if corners[i, 0] * corners[j, 1] - corners[i, 1] * corners[j, 0] < 0.0:
            return False
    return True


@register_jitable(inline="always")
def _fill_corners_from(
    corners: NDArray[np.float64], rectangle: NDArray[np.float64], x: float, y: float
) -> None:  # pragma: no cover  (compiled)
    """Fills ``corners`` (4, 2) with those of a rectangle from a sensor at (x, y), m."""
    fill_corners(corners, rectangle)
    for i in range(4):
        corners[i, 0] -= x
        corners[i, 1] -= y


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
    cosine, sine = math.cos(axis), math.sin(axis)
    slope, corners = math.tan(half_angle), np.empty((4, 2))
    for k in range(rectangles.shape[0]):
        rectangle = rectangles[k]
        _fill_corners_from(corners, rectangle, x, y)
        if _is_inside(corners, rectangle, x, y):
            return 0.0
        best = _range_to_rectangle(
            corners, rectangle, cosine, sine, slope, half_angle, best
        )
    return best


@njit(cache=True, error_model="numpy")
def fan_ranges(
    pose_WB: NDArray[np.float64],
    rectangles: NDArray[np.float64],
    axes: NDArray[np.float64],
    places: NDArray[np.float64],
    half_angles: NDArray[np.float64],
    control_point_m: float,
    reach_m: float = np.inf,
) -> NDArray[np.float64]:  # pragma: no cover  (compiled)
    """Computes the range of each range sensor of a body, as ``cone_range`` does.

    Successive sensors form a fan if they have the same position and opening angle, and
    if their directions go around in one sense. For each fan, the function visits each
    rectangle once. It computes ranges only for the sensors of the fan whose cones can
    meet the circle around the rectangle.

    Args:
        pose_WB: (3,) x, y, theta of the body frame B in the world frame W, m and rad.
        rectangles: (m, 6) rectangles (x, y, theta, length, width, radius) in W, m and
            rad.
        axes: (n,) directions of the axes of the cones in B, rad.
        places: (n, 2) positions of the sensors relative to the control point P, in the
            axes of B, m.
        half_angles: (n,) halves of the opening angles, rad.
        control_point_m: Distance of P ahead of the origin of B, m.
        reach_m: Largest range of interest, m. A larger range may be infinite instead.

    Returns:
        (n,) ranges, m. A range is infinite if no surface is inside the cone.
    """
    x, y, theta = pose_WB
    c, s = math.cos(theta), math.sin(theta)
    count = axes.size
    ranges, cosines, sines = np.full(count, np.inf), np.empty(count), np.empty(count)
    for k in range(count):
        cosines[k], sines[k] = math.cos(theta + axes[k]), math.sin(theta + axes[k])
    begin, corners = 0, np.empty((4, 2))
    while begin < count:
        end = _fan_end(begin, axes, places, half_angles)
        ahead, left = control_point_m + places[begin, 0], places[begin, 1]
        at = x + c * ahead - s * left, y + s * ahead + c * left
        fan = begin, end, axes, theta, cosines, sines
        cone = math.tan(half_angles[begin]), half_angles[begin]
        for k in range(rectangles.shape[0]):
            # The circle around the rectangle, enlarged by a margin for rounding errors.
            length, width = rectangles[k, 3], rectangles[k, 4]
            outer = 0.5 * math.sqrt(length * length + width * width)
            outer += rectangles[k, 5] + _MARGIN
            dx, dy = rectangles[k, 0] - at[0], rectangles[k, 1] - at[1]
            squared, far = dx * dx + dy * dy, reach_m + outer
            if squared <= far * far:
                circle = math.atan2(dy, dx), math.sqrt(squared), outer
                _see_rectangle(ranges, at, fan, cone, rectangles[k], circle, corners)
        begin = end
    return ranges


@njit(cache=True)
def _fan_end(
    begin: int,
    axes: NDArray[np.float64],
    places: NDArray[np.float64],
    half_angles: NDArray[np.float64],
) -> int:  # pragma: no cover  (compiled)
    """Returns the index after the last sensor of the fan that begins at ``begin``."""
    end = begin + 1
    while (
        end < axes.size
        and places[end, 0] == places[begin, 0]
        and places[end, 1] == places[begin, 1]
        and half_angles[end] == half_angles[begin]
        and (axes[end] - axes[end - 1]) * (axes[begin + 1] - axes[begin]) > 0.0
        and abs(axes[end] - axes[begin]) < math.tau
    ):
        end += 1
    return end


@register_jitable(inline="always")
def _see_rectangle(
    ranges: NDArray[np.float64],
    at: tuple[float, float],
    fan: Any,
    cone: tuple[float, float],
    rectangle: NDArray[np.float64],
    circle: tuple[float, float, float],
    corners: NDArray[np.float64],
) -> None:
    """Reduces the ranges of the sensors of a fan at ``at`` that see a rectangle.

    ``cone`` has the tangent of half of the opening angle, and this half angle, rad.
    ``circle`` is the circle around the rectangle: direction of its center in W, rad,
    distance of its center from the fan, m, and radius, m. ``corners`` (4, 2) is scratch
    memory.
    """
    begin, end, axes, theta, cosines, sines = fan
    slope, half_angle = cone
    bearing, distance, outer = circle
    _fill_corners_from(corners, rectangle, at[0], at[1])
    if distance <= outer:
        inside = _is_inside(corners, rectangle, at[0], at[1])
        for k in range(begin, end):
            ranges[k] = (
                0.0
                if inside
                else _range_to_rectangle(
                    corners,
                    rectangle,
                    cosines[k],
                    sines[k],
                    slope,
                    half_angle,
                    ranges[k],
                )
            )
        return
    # Angles relative to the middle of the fan, growing from the first to the last
    # sensor. The middle of the rectangle is at ``off``, from -pi to pi.
    middle, way = 0.5 * (axes[begin] + axes[end - 1]), axes[end - 1] - axes[begin]
    sense = -1.0 if way < 0.0 else 1.0
    off = sense * (bearing - theta - middle)
    off -= math.tau * math.floor(off / math.tau + 0.5)
    # An upper bound of asin(share), which costs less than the exact value.
    share = outer / distance
    half = share + (math.pi / 2.0 - 1.0) * share**3 + half_angle + _MARGIN
    pitch = max(abs(way) / max(end - begin - 1, 1), 1e-6)
    for turn in (-math.tau, 0.0, math.tau):
        low, high = off + turn - half, off + turn + half
        if high < -0.5 * abs(way) or low > 0.5 * abs(way):
            continue
        # The first sensor of the interval, guessed from the mean angle between sensors.
        k = begin + min(max(int((low + 0.5 * abs(way)) / pitch), 0), end - begin - 1)
        while k > begin and sense * (axes[k - 1] - middle) >= low:
            k -= 1
        while k < end and sense * (axes[k] - middle) < low:
            k += 1
        while k < end and sense * (axes[k] - middle) <= high:
            if ranges[k] > distance - outer:
                ranges[k] = _range_to_rectangle(
                    corners,
                    rectangle,
                    cosines[k],
                    sines[k],
                    slope,
                    half_angle,
                    ranges[k],
                )
            k += 1
