"""Points and rectangles in the plane: what parameters are checked by.

Compiled code has these functions from ``systems.world.geometry``.

A rectangle is (x, y, theta, length, width): centre and heading in the frame of
the caller, extents along its own x and y axes; m and rad.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from systems.framework.elementary import cos, sin


def rotate(theta: Any, x: Any, y: Any) -> tuple[Any, Any]:
    """Components in the outer frame of (x, y) given in a frame turned by theta.

    Accepts floats and AutoDiffXd. This is R = [[cos, -sin], [sin, cos]], the
    transpose of what Han 2019, eq. 15 prints.

    Args:
        theta: Angle of the inner frame in the outer one, rad.
        x: First component in the inner frame.
        y: Second component in it.

    Returns:
        (x, y) in the outer frame, in the unit of the components.
    """
    c, s = cos(theta), sin(theta)
    return c * x - s * y, s * x + c * y


def control_point(pose: Any, offset: float) -> tuple[Any, Any]:
    """Position p_WP of the control point of a body, m.

    Args:
        pose: (x, y, theta) of the body frame in W; floats or AutoDiffXd.
        offset: Distance epsilon of P ahead of the origin, m.

    Returns:
        (x, y) in W, m.
    """
    x, y, theta = pose
    return x + offset * cos(theta), y + offset * sin(theta)


def beyond_rectangle(point: Any, rectangle: Any) -> tuple[Any, Any]:
    """Vector to a point from the nearest point of a filled rectangle.

    Args:
        point: (x, y), m; floats, AutoDiffXd or arrays.
        rectangle: (x, y, theta, length, width); each may be an array, too.

    Returns:
        (du, dv) along the rectangle's own axes, m; (0, 0) inside.
    """
    x, y, theta, length, width = rectangle
    u, v = rotate(-theta, point[0] - x, point[1] - y)
    return outside(u, length / 2.0), outside(v, width / 2.0)


def outside(u: Any, half: Any) -> Any:
    """``beyond``, or ``beyond_each`` of an array.

    Args:
        u: Float, AutoDiffXd or an array.
        half: Half the length of the interval, in the unit of u.

    Returns:
        As u.
    """
    return beyond_each(u, half) if isinstance(u, np.ndarray) else beyond(u, half)


def beyond(u: Any, half: Any) -> Any:
    """How far u lies beyond the interval [-half, half].

    Args:
        u: Float or AutoDiffXd; compiled code may call it.
        half: Half the length of the interval, in the unit of u.

    Returns:
        In that unit, with the sign of u; 0 inside.
    """
    if u > half:
        return u - half
    if u < -half:
        return u + half
    return 0.0 * u


def beyond_each(u: NDArray[np.float64], half: ArrayLike) -> NDArray[np.float64]:
    """``beyond`` of the elements of an array.

    Args:
        u: (...) any unit.
        half: (...) in the same unit; broadcast with u.

    Returns:
        (...) in that unit.
    """
    return u - np.clip(u, -np.asarray(half), half)


def rectangle_clearance(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Distance between two rectangles; negative depth where they overlap.

    The depth is that of the separating-axis test: the shortest way to push
    the rectangles apart. Of two that are apart, a corner of one is nearest.

    Args:
        a: (5,) rectangle.
        b: (5,) rectangle in the same frame.

    Returns:
        Clearance in m.
    """
    separation = -np.inf
    sides = side_normals(a, b)
    for _, _, ahead, touching in sides:
        separation = max(separation, abs(ahead) - touching)
    if separation <= 0.0:
        return separation
    (ca, sa, ua, _), (_, _, va, _), (cb, sb, ub, _), (_, _, vb, _) = sides
    c, s = ca * cb + sa * sb, ca * sb - sa * cb
    half_a, half_b = (a[3] / 2.0, a[4] / 2.0), (b[3] / 2.0, b[4] / 2.0)
    squared = min(
        nearest_corner(ua, va, c, s, half_b, half_a),
        nearest_corner(-ub, -vb, c, -s, half_a, half_b),
    )
    return math.sqrt(squared)


def side_normals(
    a: NDArray[np.float64], b: NDArray[np.float64]
) -> tuple[tuple[float, float, float, float], ...]:
    """Normals of the sides of two rectangles, of a first.

    Args:
        a: (5,) rectangle.
        b: (5,) rectangle in the same frame.

    Returns:
        Of each its components, how far along it the centre of b is ahead of that of
        a, and how far the centres are apart where the shadows of both just touch, m.
    """
    ca, sa, cb, sb = math.cos(a[2]), math.sin(a[2]), math.cos(b[2]), math.sin(b[2])
    c, s = abs(ca * cb + sa * sb), abs(ca * sb - sa * cb)
    dx, dy = b[0] - a[0], b[1] - a[1]
    la, wa, lb, wb = a[3] / 2.0, a[4] / 2.0, b[3] / 2.0, b[4] / 2.0
    return (
        (ca, sa, ca * dx + sa * dy, la + c * lb + s * wb),
        (-sa, ca, ca * dy - sa * dx, wa + s * lb + c * wb),
        (cb, sb, cb * dx + sb * dy, lb + c * la + s * wa),
        (-sb, cb, cb * dy - sb * dx, wb + s * la + c * wa),
    )


def nearest_corner(
    u: float, v: float, c: float, s: float, corner: Any, half: Any
) -> float:
    """Square of the least distance of a rectangle's corners from a box.

    Args:
        u: Centre of the rectangle in the box's axes, m.
        v: See u.
        c: Cosine of the angle of the rectangle in the box's axes.
        s: Sine of it.
        corner: Half of the rectangle's extents, m.
        half: Half of the box's, m.

    Returns:
        m^2.
    """
    best = np.inf
    for ahead in (corner[0], -corner[0]):
        for left in (corner[1], -corner[1]):
            du = max(abs(u + c * ahead - s * left) - half[0], 0.0)
            dv = max(abs(v + s * ahead + c * left) - half[1], 0.0)
            best = min(best, du * du + dv * dv)
    return best
