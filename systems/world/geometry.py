"""Computes planar geometry of points, line segments, and rectangles.

A rectangle is a tuple (x, y, theta, length, width, radius) in m and rad, as in
``systems.world.plane``.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba.extending import overload, register_jitable
from numpy.typing import NDArray

from systems.framework.compiling import njit
from systems.framework.elementary import sqrt
from systems.world import plane
from systems.world.plane import (
    beyond as beyond,
    beyond_each as beyond_each,
    beyond_rectangle as beyond_rectangle,
    control_point as control_point,
    nearest_corner,
    outside,
    rectangle_corners as rectangle_corners,
    rotate as rotate,
    shorten,
    shortened,
    side_normals as side_normals,
)

#: Small number that keeps the gradient of the norm finite at zero. It is far below any
#: length of interest.
_NORM_FLOOR = 1e-12

for _function in (
    beyond,
    beyond_rectangle,
    control_point,
    nearest_corner,
    rotate,
    shorten,
    side_normals,
):
    register_jitable(_function)

rectangle_clearance = njit(cache=True)(plane.rectangle_clearance)


@register_jitable
def safe_norm(x: Any, y: Any) -> Any:
    """Computes the length of a vector (x, y), with a gradient of zero at (0, 0).

    The gradient of the exact length would be NaN there. The result differs from the
    exact length by at most 1e-12.

    Args:
        x: First component, in any unit; float or AutoDiffXd.
        y: Second component, in the same unit.

    Returns:
        Length in the unit of x, above 0. The type is AutoDiffXd if a component is
        AutoDiffXd.
    """
    return sqrt(x * x + y * y + _NORM_FLOOR**2)


@register_jitable
def control_point_velocity(theta: Any, velocity: Any, offset: float) -> tuple[Any, Any]:
    """Computes the velocity of the control point P, which is ahead of the body origin.

    Args:
        theta: Heading of the body in the world frame W, rad; a number or an array.
        velocity: (vx, vy, omega) of the origin of the body in W, m/s and rad/s. Each
            component has the shape of theta.
        offset: Distance of P ahead of the origin of the body, m.

    Returns:
        Velocity (vx, vy) of P in W, m/s. Each component has the shape of theta.
    """
    vx, vy, omega = velocity
    turning = omega * offset
    return vx - turning * np.sin(theta), vy + turning * np.cos(theta)


@register_jitable
def nearest_point_on_rectangle(point: Any, rectangle: Any) -> tuple[Any, Any]:
    """Computes the vector from a point to the nearest point of a filled rectangle.

    Args:
        point: (x, y), m; floats, AutoDiffXd, or arrays.
        rectangle: (x, y, theta, length, width, radius) in the same frame, m and rad.
            Each component except the radius may be an array.

    Returns:
        (dx, dy) in the frame of the arguments, m. The vector is (0, 0) if the point is
        inside the rectangle.
    """
    du, dv = beyond_rectangle(point, rectangle)
    return rotate(rectangle[2], -du, -dv)


@overload(outside, strict=False)
def _outside_compiled(u: Any, half: Any) -> Any:
    return lambda u, half: beyond(u, half)  # noqa: PLW0108  # numba wants its own


@overload(shortened, strict=False)
def _shortened_compiled(u: Any, v: Any, by: Any) -> Any:
    return lambda u, v, by: shorten(u, v, by)  # noqa: PLW0108  # numba wants its own


@njit(cache=True)
def corners_of(
    rectangle: NDArray[np.float64],
) -> NDArray[np.float64]:  # pragma: no cover  (compiled)
    """Computes what ``rectangle_corners`` computes, in compiled code.

    Args:
        rectangle: (6,) rectangle (x, y, theta, length, width, radius), m and rad.

    Returns:
        (4, 2) corners, counterclockwise from front left, m.
    """
    corners = np.empty((4, 2))
    fill_corners(corners, rectangle)
    return corners


@register_jitable
def fill_corners(
    corners: NDArray[np.float64], rectangle: NDArray[np.float64]
) -> None:  # pragma: no cover  (compiled)
    """Writes what ``corners_of`` returns to ``corners``, without a new array."""
    x, y, theta, length, width, _ = rectangle
    c, s = math.cos(theta), math.sin(theta)
    for k in range(4):
        u = length / 2.0 if k in (0, 3) else -length / 2.0
        v = width / 2.0 if k in (0, 1) else -width / 2.0
        corners[k, 0] = x + c * u - s * v
        corners[k, 1] = y + s * u + c * v


@njit(cache=True)
def segment_clearance(
    start: Any, end: Any, box: Any
) -> float:  # pragma: no cover  (compiled)
    """Computes the distance from a line segment to a filled rectangle.

    If the segment does not meet the rectangle, an end of the segment or a corner of the
    rectangle is nearest.

    Args:
        start: Start (x, y) of the segment, m.
        end: End (x, y) of the segment, m.
        box: Rectangle (x, y, theta, length, width, radius) in the same frame, m and
            rad.

    Returns:
        Distance, m. It is 0 if the segment meets the rectangle.
    """
    c, s = math.cos(box[2]), math.sin(box[2])
    dx, dy = start[0] - box[0], start[1] - box[1]
    x, y = c * dx + s * dy, c * dy - s * dx
    dx, dy = end[0] - start[0], end[1] - start[1]
    along_x, along_y = c * dx + s * dy, c * dy - s * dx
    half_x, half_y = box[3] / 2.0, box[4] / 2.0
    # Each pair of opposite sides bounds a slab. The segment meets the rectangle if one
    # of its points is in both slabs.
    enter, leave = 0.0, 1.0
    for at, along, half in ((x, along_x, half_x), (y, along_y, half_y)):
        safe = along if abs(along) >= 1e-12 else 1e-12
        one, other = (-half - at) / safe, (half - at) / safe
        enter, leave = max(enter, min(one, other)), min(leave, max(one, other))
    if enter <= leave:
        return 0.0
    nearest = min(
        math.hypot(beyond(x, half_x), beyond(y, half_y)),
        math.hypot(beyond(x + along_x, half_x), beyond(y + along_y, half_y)),
    )
    squared = max(along_x * along_x + along_y * along_y, 1e-18)
    for corner_x in (half_x, -half_x):
        for corner_y in (half_y, -half_y):
            away_x, away_y = corner_x - x, corner_y - y
            t = (away_x * along_x + away_y * along_y) / squared
            t = min(max(t, 0.0), 1.0)
            distance = math.hypot(away_x - t * along_x, away_y - t * along_y)
            nearest = min(nearest, distance)
    return max(nearest - box[5], 0.0)
