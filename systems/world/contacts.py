"""Computes when moving rectangles touch.

``systems.world.plane`` defines the rectangles.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from systems.framework.compiling import njit
from systems.world.geometry import corners_of, rectangle_clearance, side_normals

#: ``first_overlap`` may miss overlaps up to this depth within a step, m.
_SHALLOW_M = 1e-4
#: Clearance below which faces with a radius touch in ``contact_time``, m.
_TOUCH_M = 1e-9


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
        a: (6,) first rectangle (x, y, theta, length, width, radius), m and rad.
        b: (6,) second rectangle in the same frame.
        vx: First component of the velocity of a relative to b, m/s.
        vy: Second component of the velocity of a relative to b, m/s.

    Returns:
        Time, s. It is 0 if the rectangles overlap now. It is infinite if they never
        touch.
    """
    if a[5] + b[5] > 0.0:
        return _rounded_contact_time(a, b, vx, vy)
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
def _rounded_contact_time(
    a: NDArray[np.float64], b: NDArray[np.float64], vx: float, vy: float
) -> float:  # pragma: no cover  (compiled)
    """Returns ``contact_time`` for rectangles of which at least one has a radius.

    A contact begins in one of two ways: a corner comes as near to a corner as the sum
    of both radii, or a face comes as near to a corner or another face.
    """
    speed, radius, best = math.hypot(vx, vy), a[5] + b[5], np.inf
    if rectangle_clearance(a, b) <= 0.0:
        return 0.0
    if speed < 1e-12:
        return np.inf
    corners_a, corners_b = corners_of(a), corners_of(b)
    for i in range(4):
        for j in range(4):
            dx = corners_b[j, 0] - corners_a[i, 0]
            dy = corners_b[j, 1] - corners_a[i, 1]
            along, off = (dx * vx + dy * vy) / speed, (dx * vy - dy * vx) / speed
            if along > 0.0 and abs(off) < radius:
                way = along - math.sqrt(radius * radius - off * off)
                best = min(best, way / speed)
    moved = a.copy()
    for nx, ny, ahead, touching in side_normals(a, b):
        normal = vx * nx + vy * ny
        if abs(normal) < 1e-12:
            continue
        reach = math.copysign(touching + radius, normal)
        time = (ahead - reach) / normal
        if 0.0 <= time < best:
            moved[0], moved[1] = a[0] + time * vx, a[1] + time * vy
            if rectangle_clearance(moved, b) <= _TOUCH_M:
                best = time
    return best


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
        size: Length, width and radius of the first rectangle, m.
        poses: (n + 1, 3) x, y, theta of the second rectangle at equal intervals over
            the step, m and rad. With one pose, the second rectangle is at rest.
        other_size: Length, width and radius of the second rectangle, m.

    Returns:
        Share of the step before the first overlap, 0 to 1. It is infinite if the
        rectangles do not overlap.
    """
    a = np.array((0.0, 0.0, 0.0, size[0], size[1], size[2]))
    b = np.array((0.0, 0.0, 0.0, other_size[0], other_size[1], other_size[2]))
    # Turning moves the corners. The discs around the corners move as the corners do.
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
