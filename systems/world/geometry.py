"""Planar geometry of points, rectangles and sensor cones.

A rectangle is (x, y, theta, length, width): centre and heading in the frame of
the caller, extents along its own x and y axes; m and rad.
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

#: Keeps the norm's gradient finite at zero; far below any length that counts.
_NORM_FLOOR = 1e-12

#: A shallower overlap may be missed between two instants, m.
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
    """Length of (x, y); at zero its gradient is zero instead of NaN.

    Accepts floats and AutoDiffXd. Differs from the exact norm by at most
    1e-12.

    Args:
        x: First component, in any unit.
        y: Second component, in the same one.

    Returns:
        In that unit, above 0; AutoDiffXd where a component is.
    """
    return sqrt(x * x + y * y + _NORM_FLOOR**2)


@register_jitable
def control_point_velocity(theta: Any, velocity: Any, offset: float) -> tuple[Any, Any]:
    """Velocity v_WP of the control point of a body, m/s.

    Args:
        theta: Heading of the body frame in W, rad; a number or an array.
        velocity: (vx, vy, omega) of the body frame in W, m/s and rad/s, each as theta.
        offset: Distance epsilon of P ahead of the origin, m.

    Returns:
        (vx, vy) in W, m/s, of the shape of theta.
    """
    vx, vy, omega = velocity
    turning = omega * offset
    return vx - turning * np.sin(theta), vy + turning * np.cos(theta)


@register_jitable
def nearest_point_on_rectangle(point: Any, rectangle: Any) -> tuple[Any, Any]:
    """Vector from a point to the nearest point of a filled rectangle.

    Args:
        point: (x, y), m; floats, AutoDiffXd or arrays.
        rectangle: (x, y, theta, length, width); each may be an array, too.

    Returns:
        (dx, dy) in the frame of the arguments, m; (0, 0) inside.
    """
    du, dv = beyond_rectangle(point, rectangle)
    return rotate(rectangle[2], -du, -dv)


@overload(outside, strict=False)
def _outside_compiled(u: Any, half: Any) -> Any:
    return lambda u, half: beyond(u, half)  # noqa: PLW0108  # numba wants its own


def rectangle_corners(rectangle: ArrayLike) -> NDArray[np.float64]:
    """(4, 2) corners, counter-clockwise from front left."""
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
    """Distance from the origin to the segment a-b."""
    ex, ey = bx - ax, by - ay
    squared = ex * ex + ey * ey
    t = 0.0 if squared == 0.0 else -(ax * ex + ay * ey) / squared
    t = min(1.0, max(0.0, t))
    return math.hypot(ax + t * ex, ay + t * ey)


@njit(cache=True)
def cone_range(
    x: float, y: float, axis: float, half_angle: float, rectangles: NDArray[np.float64]
) -> float:  # pragma: no cover  (compiled)
    """Distance to the nearest surface inside a sensor's cone.

    Each edge is cut to the part inside the cone, whose nearest point is then
    exact; nearer surfaces hide farther ones because only the nearest counts.

    Args:
        x: Position of the sensor, m.
        y: Position of the sensor, m.
        axis: Direction of the cone's axis, rad.
        half_angle: Half of the opening angle, rad, below pi/2.
        rectangles: (n, 5) rectangles in the same frame.

    Returns:
        Range in m; 0 inside a rectangle, infinity where nothing is seen.
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
            if dx * fy - dy * fx < 0.0:
                inside = False
            ax, ay = ca * dx + sa * dy, -sa * dx + ca * dy
            bx, by = ca * fx + sa * fy, -sa * fx + ca * fy
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
    half_angle: float,
    control_point_m: float,
) -> NDArray[np.float64]:  # pragma: no cover  (compiled)
    """``cone_range`` of each sensor of a body.

    Args:
        pose_WB: (3,) x, y, theta of the body, m and rad.
        rectangles: (m, 5) rectangles in W.
        axes: (n,) directions of the cones in B, rad.
        places: (n, 2) sensors from P in B axes, m.
        half_angle: Half of the opening angle, rad.
        control_point_m: Distance of P ahead of the origin of B, m.

    Returns:
        (n,) m; infinite where a cone is empty.
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
            half_angle,
            rectangles,
        )
    return ranges


@njit(cache=True)
def segment_clearance(
    start: Any, end: Any, box: Any
) -> float:  # pragma: no cover  (compiled)
    """Distance of a line segment from a filled rectangle.

    Args:
        start: (x, y), m.
        end: (x, y), m.
        box: (x, y, theta, length, width) in the same frame.

    Returns:
        m; 0 if they meet.
    """
    c, s = math.cos(box[2]), math.sin(box[2])
    dx, dy = start[0] - box[0], start[1] - box[1]
    x, y = c * dx + s * dy, c * dy - s * dx
    dx, dy = end[0] - start[0], end[1] - start[1]
    along_x, along_y = c * dx + s * dy, c * dy - s * dx
    half_x, half_y = box[3] / 2.0, box[4] / 2.0
    # They meet if the segment crosses both of the box's slabs at one time.
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
    """Time until two rectangles touch, the first moving at (vx, vy), unturned.

    Along each side's normal the shadows of both overlap during one interval of
    time; convex shapes touch while all of these intervals do.

    Args:
        a: (5,) rectangle.
        b: (5,) rectangle in the same frame.
        vx: Velocity of a relative to b, m/s.
        vy: See vx.

    Returns:
        s; 0 where they overlap, infinite where they never touch.
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
    """When during a step a rectangle first overlaps another, both moving.

    The first one goes straight and turns evenly throughout the step, the other one from
    each of its poses to the next. An overlap at the end of such a part counts from that
    end. Overlaps within a part are searched for by conservative advancement: as long as
    no point can have moved farther than the clearance, nothing touches. So no overlap
    deeper than 0.1 mm is missed, however fast both are.

    Args:
        before: (x, y, theta) of the first rectangle before the step, m and rad.
        now: The same after it.
        size: Its length and width, m.
        poses: (n + 1, 3) x, y, theta of the other one, evenly over the step; a single
            pose asks about the end of the step alone.
        other_size: Its length and width, m.

    Returns:
        Part of the step that has passed, 0 to 1; infinite where they do not overlap.
    """
    a, b = np.zeros(5), np.zeros(5)
    a[3], a[4], b[3], b[4] = size[0], size[1], other_size[0], other_size[1]
    reach_a, reach_b = 0.5 * math.hypot(a[3], a[4]), 0.5 * math.hypot(b[3], b[4])
    parts, last = max(len(poses) - 1, 1), len(poses) - 1
    # What both move in each part, and how much nearer any two points can come, m.
    ways_a, ways_b, nearing = np.empty(3), np.zeros((parts, 3)), np.empty(parts)
    for j in range(3):
        ways_a[j] = (now[j] - before[j]) / parts
    for k in range(last):
        for j in range(3):
            ways_b[k, j] = poses[k + 1, j] - poses[k, j]
        # Headings of paths jump by a whole turn.
        ways_b[k, 2] = (ways_b[k, 2] + math.pi) % math.tau - math.pi
    for k in range(parts):
        nearing[k] = (
            math.hypot(ways_b[k, 0] - ways_a[0], ways_b[k, 1] - ways_a[1])
            + abs(ways_a[2]) * reach_a
            + abs(ways_b[k, 2]) * reach_b
        )
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
        # What overlaps at the begin of a step has been found in the one before.
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
    """Clearance of two rectangles that have gone a part of their ways, m."""
    a, b = a.copy(), b.copy()
    for j in range(3):
        a[j] += part * way_a[j]
        b[j] += part * way_b[j]
    return rectangle_clearance(a, b)
