"""Computes geometry of points and rectangles in the plane, without compiled code.

The checks of parameters use these functions. Compiled code gets the same functions from
``systems.world.geometry``.

A rectangle is a tuple (x, y, theta, length, width, radius) in m and rad. The center
(x, y) and the heading theta are given in any frame that the caller chooses. The length
is along the rectangle's own x axis. The width is along its own y axis. The radius
thickens the rectangle: all points within the radius of it belong to it, too, so that
its corners are round. A disc has the length 0 and the width 0. A line segment has only
a length. Both may be 0 for any radius.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from systems.framework.elementary import cos, sin, sqrt


def rotate(theta: Any, x: Any, y: Any) -> tuple[Any, Any]:
    """Transforms a vector from an inner frame to an outer frame.

    The inner frame is turned by theta relative to the outer frame. The function
    multiplies the vector by R = [[cos, -sin], [sin, cos]]. Eq. 15 of Han 2019 prints
    the transpose of R.

    Args:
        theta: Angle of the inner frame in the outer frame, rad; float or AutoDiffXd.
        x: First component in the inner frame, any unit; float or AutoDiffXd.
        y: Second component in the inner frame, in the same unit.

    Returns:
        (x, y) in the outer frame, in the same unit.
    """
    c, s = cos(theta), sin(theta)
    return c * x - s * y, s * x + c * y


def control_point(pose: Any, offset: float) -> tuple[Any, Any]:
    """Computes the position of the control point P, which is ahead of the body origin.

    Args:
        pose: (x, y, theta) of the body in the world frame W, m and rad; floats or
            AutoDiffXd.
        offset: Distance of P ahead of the origin of the body, m.

    Returns:
        (x, y) of P in W, m.
    """
    x, y, theta = pose
    return x + offset * cos(theta), y + offset * sin(theta)


def beyond_rectangle(point: Any, rectangle: Any) -> tuple[Any, Any]:
    """Computes the vector from the nearest point of a filled rectangle to a point.

    Args:
        point: (x, y), m; floats, AutoDiffXd, or arrays.
        rectangle: (x, y, theta, length, width, radius) in the same frame, m and rad.
            Each component except the radius may be an array.

    Returns:
        Vector (du, dv) in the rectangle's own axes, m. It is (0, 0) if the point is
        inside the rectangle.
    """
    x, y, theta, length, width, radius = rectangle
    u, v = rotate(-theta, point[0] - x, point[1] - y)
    du, dv = outside(u, length / 2.0), outside(v, width / 2.0)
    if radius == 0.0:
        return du, dv
    return shortened(du, dv, radius)


def shortened(u: Any, v: Any, by: float) -> tuple[Any, Any]:
    """Shortens a vector (u, v), or replaces it by (0, 0) if it is not long enough.

    The function calls ``shorten`` for numbers and ``shorten_each`` for arrays.

    Args:
        u: First component in any unit; float, AutoDiffXd, or array.
        v: Second component in the same unit.
        by: Length to take away, in the same unit.

    Returns:
        Components of the shorter vector, with the type of u and v.
    """
    return shorten_each(u, v, by) if isinstance(u, np.ndarray) else shorten(u, v, by)


def shorten(u: Any, v: Any, by: float) -> tuple[Any, Any]:
    """Does what ``shortened`` does, for numbers. Compiled code may call it.

    Args:
        u: First component in any unit; float or AutoDiffXd.
        v: Second component in the same unit.
        by: Length to take away, in the same unit.

    Returns:
        Components of the shorter vector, with the type of u and v.
    """
    squared = u * u + v * v
    if squared <= by * by:
        return 0.0 * u, 0.0 * v
    share = 1.0 - by / sqrt(squared)
    return share * u, share * v


def shorten_each(
    u: NDArray[np.float64], v: NDArray[np.float64], by: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Does what ``shortened`` does, for each element of two arrays.

    Args:
        u: First components of any shape, in any unit.
        v: Second components of the same shape, in the same unit.
        by: Length to take away, in the same unit.

    Returns:
        Components of the shorter vectors.
    """
    length = np.sqrt(u * u + v * v)
    share = 1.0 - by / np.maximum(length, by)
    return share * u, share * v


def outside(u: Any, half: Any) -> Any:
    """Computes by how much u is outside the interval [-half, half], for any type of u.

    The function calls ``beyond`` for a number and ``beyond_each`` for an array.

    Args:
        u: Coordinate in any unit; float, AutoDiffXd, or array.
        half: Half of the length of the interval, in the unit of u.

    Returns:
        Distance with the sign, type, and unit of u. It is 0 inside the interval.
    """
    return beyond_each(u, half) if isinstance(u, np.ndarray) else beyond(u, half)


def beyond(u: Any, half: Any) -> Any:
    """Computes by how much a number u is outside the interval [-half, half].

    Compiled code may call this function.

    Args:
        u: Coordinate in any unit; float or AutoDiffXd.
        half: Half of the length of the interval, in the unit of u.

    Returns:
        Distance with the sign and unit of u. It is 0 inside the interval.
    """
    if u > half:
        return u - half
    if u < -half:
        return u + half
    return 0.0 * u


def beyond_each(u: NDArray[np.float64], half: ArrayLike) -> NDArray[np.float64]:
    """Computes by how much each element of an array is outside [-half, half].

    Args:
        u: Coordinates of any shape and in any unit.
        half: Half of the length of each interval, in the unit of u. The shape must
            broadcast with the shape of u.

    Returns:
        Distances in the broadcast shape, with the signs and the unit of u. They are 0
        inside the interval.
    """
    return u - np.clip(u, -np.asarray(half), half)


def rectangle_corners(rectangle: ArrayLike) -> NDArray[np.float64]:
    """Returns the (4, 2) corners, counterclockwise from front left, m.

    Args:
        rectangle: (6,) rectangle (x, y, theta, length, width, radius), m and rad.

    Returns:
        Corners in the frame of the rectangle. If the rectangle has a radius, these are
        the centers of its round corners.
    """
    x, y, theta, length, width, _ = np.asarray(rectangle, dtype=float)
    signs = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
    local = signs * np.array([length / 2.0, width / 2.0])
    c, s = math.cos(theta), math.sin(theta)
    return local @ np.array([[c, s], [-s, c]]) + np.array([x, y])


def rectangle_clearance(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Computes the distance between two rectangles, which is negative if they overlap.

    If the rectangles overlap, the result is minus the depth of the overlap. The depth
    is the length of the shortest motion that separates the rectangles (separating-axis
    test). Otherwise a corner of one rectangle is nearest to the other rectangle, and
    the result is the distance of this corner. The radii reduce this result for the
    rectangles without radii.

    Args:
        a: (6,) first rectangle (x, y, theta, length, width, radius), m and rad.
        b: (6,) second rectangle in the same frame.

    Returns:
        Clearance, m.
    """
    separation = -np.inf
    sides = side_normals(a, b)
    for _, _, ahead, touching in sides:
        separation = max(separation, abs(ahead) - touching)
    if separation <= 0.0:
        return separation - (a[5] + b[5])
    (ca, sa, ua, _), (_, _, va, _), (cb, sb, ub, _), (_, _, vb, _) = sides
    c, s = ca * cb + sa * sb, ca * sb - sa * cb
    half_a, half_b = (a[3] / 2.0, a[4] / 2.0), (b[3] / 2.0, b[4] / 2.0)
    squared = min(
        nearest_corner(ua, va, c, s, half_b, half_a),
        nearest_corner(-ub, -vb, c, -s, half_a, half_b),
    )
    return math.sqrt(squared) - (a[5] + b[5])


def side_normals(
    a: NDArray[np.float64], b: NDArray[np.float64]
) -> tuple[tuple[float, float, float, float], ...]:
    """Returns the unit normals of the sides of two rectangles, each with two distances.

    The first two normals are those of a. The last two normals are those of b. The
    function ignores the radii of the rectangles.

    Args:
        a: (6,) first rectangle (x, y, theta, length, width, radius), m and rad.
        b: (6,) second rectangle in the same frame.

    Returns:
        One tuple (x, y, ahead, touching) per normal (x, y). ``ahead`` is the signed
        distance from the center of a to the center of b along the normal, m.
        ``touching`` is the value of this distance at which the projections of both
        rectangles onto the normal just touch, m.
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
    """Computes the squared distance from a box to the nearest corner of a rectangle.

    All coordinates are along the axes of the box, from its center.

    Args:
        u: First coordinate of the center of the rectangle, m.
        v: Second coordinate of the center of the rectangle, m.
        c: Cosine of the angle of the rectangle relative to the box.
        s: Sine of this angle.
        corner: Half of the length and half of the width of the rectangle, m.
        half: Half of the length and half of the width of the box, m.

    Returns:
        Squared distance, m^2.
    """
    best = np.inf
    for ahead in (corner[0], -corner[0]):
        for left in (corner[1], -corner[1]):
            du = max(abs(u + c * ahead - s * left) - half[0], 0.0)
            dv = max(abs(v + s * ahead + c * left) - half[1], 0.0)
            best = min(best, du * du + dv * dv)
    return best
