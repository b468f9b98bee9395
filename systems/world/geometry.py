"""Computes planar geometry of points, rectangles, and sensor cones.

A rectangle is a tuple (x, y, theta, length, width) in m and rad. The center (x, y) and
the heading theta are given in any frame that the caller chooses. The length is along
the rectangle's own x axis. The width is along its own y axis.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba.extending import overload, register_jitable
from numpy.typing import ArrayLike, NDArray

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
    rotate as rotate,
    side_normals,
)

#: Small number that keeps the gradient of the norm finite at zero. It is far below any
#: length of interest.
_NORM_FLOOR = 1e-12

#: ``first_overlap`` may miss overlaps up to this depth within a step, m.
_SHALLOW_M = 1e-4

for _function in (
    beyond,
    beyond_rectangle,
    control_point,
    nearest_corner,
    rotate,
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
        rectangle: (x, y, theta, length, width) in the same frame, m and rad. Each
            component may be an array.

    Returns:
        (dx, dy) in the frame of the arguments, m. The vector is (0, 0) if the point is
        inside the rectangle.
    """
    du, dv = beyond_rectangle(point, rectangle)
    return rotate(rectangle[2], -du, -dv)


@overload(outside, strict=False)
def _outside_compiled(u: Any, half: Any) -> Any:
    return lambda u, half: beyond(u, half)  # noqa: PLW0108  # numba wants its own


def rectangle_corners(rectangle: ArrayLike) -> NDArray[np.float64]:
    """Returns the (4, 2) corners, counterclockwise from front left, m."""
    x, y, theta, length, width = np.asarray(rectangle, dtype=float)
    signs = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
    local = signs * np.array([length / 2.0, width / 2.0])
    c, s = math.cos(theta), math.sin(theta)
    return local @ np.array([[c, s], [-s, c]]) + np.array([x, y])


@njit(cache=True)
def _corners(
    rectangle: NDArray[np.float64],
) -> NDArray[np.float64]:  # pragma: no cover  (compiled)
    x, y, theta, length, width = rectangle
    c, s = math.cos(theta), math.sin(theta)
    corners = np.empty((4, 2))
    for k in range(4):
        u = length / 2.0 if k in (0, 3) else -length / 2.0
        v = width / 2.0 if k in (0, 1) else -width / 2.0
        corners[k, 0] = x + c * u - s * v
        corners[k, 1] = y + s * u + c * v
    return corners


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
def cone_range(
    x: float, y: float, axis: float, half_angle: float, rectangles: NDArray[np.float64]
) -> float:  # pragma: no cover  (compiled)
    """Computes the distance from a sensor to the nearest surface inside its cone.

    The function cuts each edge of each rectangle to the part inside the cone. Then it
    computes the exact distance from the sensor to this part. The range is the smallest
    of these distances. A hidden surface is never the nearest, so the function does not
    check whether surfaces are hidden.

    Args:
        x: First coordinate of the sensor, m.
        y: Second coordinate of the sensor, m.
        axis: Direction of the axis of the cone, rad.
        half_angle: Half of the opening angle, rad, below pi/2.
        rectangles: (n, 5) rectangles (x, y, theta, length, width) in the same frame, m
            and rad.

    Returns:
        Range, m. It is 0 if the sensor is inside a rectangle. It is infinite if no
        surface is inside the cone.
    """
    best = np.inf
    ca, sa = math.cos(axis), math.sin(axis)
    slope = math.tan(half_angle)
    for k in range(rectangles.shape[0]):
        corners = _corners(rectangles[k])
        inside = True
        for i in range(4):
            j = (i + 1) % 4
            dx, dy = corners[i, 0] - x, corners[i, 1] - y
            fx, fy = corners[j, 0] - x, corners[j, 1] - y
            # The sensor is inside the rectangle if it is to the left of all edges.
            if dx * fy - dy * fx < 0.0:
                inside = False
            ax, ay = ca * dx + sa * dy, -sa * dx + ca * dy
            bx, by = ca * fx + sa * fy, -sa * fx + ca * fy
            # The part of the edge from low to high is between both sides of the cone.
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
            if low <= high:
                ex, ey = bx - ax, by - ay
                distance = _nearest_on_segment(
                    ax + low * ex, ay + low * ey, ax + high * ex, ay + high * ey
                )
                best = min(best, distance)
        if inside:
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
        rectangles: (m, 5) rectangles (x, y, theta, length, width) in W, m and rad.
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
        box: Rectangle (x, y, theta, length, width) in the same frame, m and rad.

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
    return nearest


@njit(cache=True)
def contact_time(
    a: NDArray[np.float64], b: NDArray[np.float64], vx: float, vy: float
) -> float:  # pragma: no cover  (compiled)
    """Computes the time until two rectangles touch, if they move without turning.

    The function projects both rectangles onto the normal of each side. On each normal,
    the two projections overlap during one interval of time. The rectangles are in
    contact at a time that lies in all intervals. The contact therefore begins when the
    last of these intervals begins. If one of the intervals has ended by then, the
    rectangles never touch.

    Args:
        a: (5,) first rectangle (x, y, theta, length, width), m and rad.
        b: (5,) second rectangle in the same frame.
        vx: First component of the velocity of a relative to b, m/s.
        vy: Second component of the velocity of a relative to b, m/s.

    Returns:
        Time, s. It is 0 if the rectangles overlap now. It is infinite if they never
        touch.
    """
    enter, leave = 0.0, np.inf
    for nx, ny, ahead, touching in side_normals(a, b):
        speed = vx * nx + vy * ny
        if abs(speed) < 1e-12:
            if abs(ahead) > touching:
                return np.inf
            continue
        first, second = (ahead - touching) / speed, (ahead + touching) / speed
        enter = max(enter, min(first, second))
        leave = min(leave, max(first, second))
    return enter if enter <= leave else np.inf


@njit(cache=True)
def first_overlap(
    before: Any, now: Any, size: Any, poses: NDArray[np.float64], other_size: Any
) -> float:  # pragma: no cover  (compiled)
    """Computes when two moving rectangles first overlap during a time step.

    The first rectangle moves straight and turns evenly during the whole step. The poses
    of the second rectangle divide the step into equal parts. In each part, the second
    rectangle moves straight and turns evenly from one pose to the next.

    If the rectangles overlap at the end of a part, the function returns the time of
    that end. Otherwise it searches within the part by conservative advancement:

    1. Compute the clearance between the rectangles, or use 0.1 mm if the clearance is
       less.
    2. Divide this distance by the largest speed at which points of the two rectangles
       can approach each other. The rectangles cannot overlap by more than 0.1 mm
       before this time has passed.
    3. Advance by this time and repeat.

    The function therefore finds every overlap deeper than 0.1 mm, at any speed.

    Args:
        before: (x, y, theta) of the first rectangle before the step, m and rad.
        now: (x, y, theta) of the first rectangle after the step, m and rad.
        size: Length and width of the first rectangle, m.
        poses: (n + 1, 3) x, y, theta of the second rectangle at equal intervals over
            the step, m and rad. With one pose, the second rectangle is at rest.
        other_size: Length and width of the second rectangle, m.

    Returns:
        Share of the step before the first overlap, 0 to 1. It is infinite if the
        rectangles do not overlap.
    """
    a, b = np.zeros(5), np.zeros(5)
    a[3], a[4], b[3], b[4] = size[0], size[1], other_size[0], other_size[1]
    reach_a, reach_b = 0.5 * math.hypot(a[3], a[4]), 0.5 * math.hypot(b[3], b[4])
    parts, last = max(len(poses) - 1, 1), len(poses) - 1
    # Motion of both rectangles in each part, and the largest distance in m by which two
    # of their points can approach each other.
    ways_a, ways_b, nearing = np.empty(3), np.zeros((parts, 3)), np.empty(parts)
    for j in range(3):
        ways_a[j] = (now[j] - before[j]) / parts
    for k in range(last):
        for j in range(3):
            ways_b[k, j] = poses[k + 1, j] - poses[k, j]
        # The heading of a path may jump by a whole turn.
        ways_b[k, 2] = (ways_b[k, 2] + math.pi) % math.tau - math.pi
    for k in range(parts):
        nearing[k] = (
            math.hypot(ways_b[k, 0] - ways_a[0], ways_b[k, 1] - ways_a[1])
            + abs(ways_a[2]) * reach_a
            + abs(ways_b[k, 2]) * reach_b
        )
    # Rectangles that are far apart at the end cannot have touched.
    for j in range(3):
        a[j], b[j] = now[j], poses[last, j]
    if rectangle_clearance(a, b) > nearing.sum():
        return np.inf
    for k in range(parts):
        for j in range(3):
            a[j], b[j] = before[j] + k * ways_a[j], poses[min(k, last), j]
        if _clearance_after(1.0, a, b, ways_a, ways_b[k]) < 0.0:
            return (k + 1) / parts
        clearance, t = rectangle_clearance(a, b), 0.0
        # An overlap at the start of a part was found at the end of the previous part.
        while clearance >= 0.0 and nearing[k] > 0.0:
            t += max(clearance, _SHALLOW_M) / nearing[k]
            if t >= 1.0:
                break
            clearance = _clearance_after(t, a, b, ways_a, ways_b[k])
            if clearance < 0.0:
                return (k + t) / parts
    return np.inf


@njit(cache=True)
def _clearance_after(
    part: float, a: Any, b: Any, way_a: Any, way_b: Any
) -> float:  # pragma: no cover  (compiled)
    """Returns the clearance, m, of two rectangles after a share of their motions."""
    a, b = a.copy(), b.copy()
    for j in range(3):
        a[j] += part * way_a[j]
        b[j] += part * way_b[j]
    return rectangle_clearance(a, b)
