"""Contact of the robot's rectangle with points while the robot drives along an arc."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from systems.framework.compiling import njit


@njit(cache=True)
def time_to_contact(
    places: Any, motion: tuple[float, float], half: tuple[float, float]
) -> float:  # pragma: no cover  (compiled)
    """Computes when the moving robot first covers one of several points.

    The robot keeps its speed and yaw rate. Seen from the robot, the points then move:
    straight backward if the yaw rate is zero, otherwise on circles around the center of
    the robot's arc. The function computes for each point when its line or circle first
    meets the rectangle of the body.

    Args:
        places: (n, 2) points in the body frame of the robot, m.
        motion: Speed, m/s, and yaw rate, rad/s.
        half: Half of the body's length and half of its width, m.

    Returns:
        Time of the first contact, s; infinite if there is none. Points that the body
        already covers do not count.
    """
    v, w = motion
    a, b = half
    best = np.inf
    if abs(w) < 1e-6:
        for n in range(len(places)):
            gap = math.copysign(places[n, 0], v * places[n, 0]) - a
            if v != 0.0 and gap > 0.0 and abs(places[n, 1]) <= b:
                best = min(best, gap / abs(v))
        return best
    # Center of the arc: (0, turn). Only radii from least to most meet the body.
    turn = v / w
    least, most = max(abs(turn) - b, 0.0), math.hypot(a, abs(turn) + b)
    for n in range(len(places)):
        x, y = places[n, 0], places[n, 1] - turn
        squared = x * x + y * y
        if squared < least * least or squared > most * most:
            continue
        if abs(x) <= a and abs(places[n, 1]) <= b:
            continue
        far = math.sqrt(squared)
        angle = _angle_to_contact(x, y, far, turn, half, -w)
        best = min(best, angle / abs(w))
    return best


@njit(cache=True)
def _angle_to_contact(
    x: float, y: float, far: float, turn: float, half: tuple[float, float], sign: float
) -> float:  # pragma: no cover  (compiled)
    """Computes the angle by which a point turns about (0, 0) until it meets the body.

    The point starts at (x, y) and keeps the distance ``far`` from (0, 0). The center of
    the body is at (0, -turn). The point turns counterclockwise if ``sign`` is positive.
    """
    a, b = half
    begin, best = math.atan2(y, x), np.inf
    for side in (1.0, -1.0):
        for other in (1.0, -1.0):
            # Crossing of the front or rear side.
            if far >= a:
                ey = other * math.sqrt(far * far - a * a)
                if abs(ey + turn) <= b:
                    off = math.atan2(ey, side * a) - begin
                    best = min(best, math.copysign(1.0, sign) * off % math.tau)
            # Crossing of the left or right side.
            ey = side * b - turn
            if far >= abs(ey):
                ex = other * math.sqrt(far * far - ey * ey)
                if abs(ex) <= a:
                    off = math.atan2(ey, ex) - begin
                    best = min(best, math.copysign(1.0, sign) * off % math.tau)
    return best


@njit(cache=True)
def in_body_axes(
    places: Any, pose: Any, half: tuple[float, float]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:  # pragma: no cover  (compiled)
    """Sorts points into those outside a rectangle around the axle and those inside.

    Args:
        places: (n, 2) or (n, 3) points: x and y in the world frame W, m.
        pose: Pose (x, y, theta) of the axle in W, m and rad.
        half: Half of the length and half of the width of the rectangle, m.

    Returns:
        (k, 2) points outside and (n - k, 2) points inside, in the body frame B, m.
    """
    found, beyond, within = np.empty((len(places), 2)), 0, len(places)
    c, s = math.cos(pose[2]), math.sin(pose[2])
    for n in range(len(places)):
        dx, dy = places[n, 0] - pose[0], places[n, 1] - pose[1]
        x, y = c * dx + s * dy, c * dy - s * dx
        if abs(x) <= half[0] and abs(y) <= half[1]:
            within -= 1
            found[within] = x, y
        else:
            found[beyond] = x, y
            beyond += 1
    return found[:beyond], found[within:]
