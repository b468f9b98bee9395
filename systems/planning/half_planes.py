"""Search for the permitted velocity that is nearest to a wanted velocity.

A velocity is permitted if it lies in all given half planes and does not exceed the top
speed.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from systems.framework.compiling import njit

#: Tolerance of a constraint, m/s.
_ROUNDING = 1e-9
#: Number of bisections that find the least slack.
_HALVINGS = 40


@njit(cache=True)
def _obeys(
    planes: Any, x: float, y: float, top: float, slack: float, hard: int
) -> bool:  # pragma: no cover  (compiled)
    """Checks whether a velocity obeys all half planes, with the given slack."""
    if x * x + y * y > (top + _ROUNDING) ** 2:
        return False
    for k in range(len(planes)):
        offset = _offset(planes, k, slack, hard) - _ROUNDING
        if planes[k, 0] * x + planes[k, 1] * y < offset:
            return False
    return True


@njit(cache=True)
def _offset(
    planes: Any, k: int, slack: float, hard: int
) -> float:  # pragma: no cover  (compiled)
    """Return the offset of a plane, minus the slack if the plane is soft."""
    soft = k < len(planes) - hard
    return planes[k, 2] - slack if soft else planes[k, 2]


@njit(cache=True)
def _nearest(
    planes: Any, wanted: Any, top: float, slack: float, hard: int
) -> tuple[float, float, bool]:  # pragma: no cover  (compiled)
    """Finds the permitted velocity nearest to the wanted velocity for a given slack.

    The slack is the distance by which all soft half planes move outward, m/s. The
    solution is the wanted velocity, its projection on a border, or the intersection of
    two borders. The function tries all these candidates. In its loops, the indices 0 to
    ``count - 1`` stand for the borders of the half planes, ``count`` stands for the
    circle of the top speed, and -1 stands for no border.

    Returns:
        Velocity x, m/s; velocity y, m/s; and whether there is a permitted velocity.
    """
    count = len(planes)
    found = 0.0, 0.0, False
    least = np.inf
    candidates = np.empty((4, 2))
    speed = math.hypot(wanted[0], wanted[1])
    for i in range(-1, count + 1):
        for j in range(-1, i) if i > 0 else range(-1, 0):
            tried = 0
            # The wanted velocity itself.
            if i < 0:
                candidates[0, 0], candidates[0, 1], tried = wanted[0], wanted[1], 1
            elif i == count and j < 0:
                # The projection on the circle of the top speed.
                part = top / speed if speed > 0.0 else 0.0
                candidates[0, 0], candidates[0, 1] = part * wanted[0], part * wanted[1]
                tried = 1
            elif i == count:
                # The two intersections of plane j with the circle.
                n0, n1 = planes[j, 0], planes[j, 1]
                b = _offset(planes, j, slack, hard)
                if abs(b) <= top:
                    along = math.sqrt(top * top - b * b)
                    for sign in (1.0, -1.0):
                        candidates[tried, 0] = n0 * b - sign * n1 * along
                        candidates[tried, 1] = n1 * b + sign * n0 * along
                        tried += 1
            elif j < 0:
                # The projection on plane i.
                n0, n1 = planes[i, 0], planes[i, 1]
                b = _offset(planes, i, slack, hard)
                to = b - n0 * wanted[0] - n1 * wanted[1]
                candidates[0, 0] = wanted[0] + to * n0
                candidates[0, 1] = wanted[1] + to * n1
                tried = 1
            else:
                # The intersection of planes i and j.
                cross = planes[i, 0] * planes[j, 1] - planes[i, 1] * planes[j, 0]
                if abs(cross) > 1e-9:
                    b = _offset(planes, i, slack, hard)
                    d = _offset(planes, j, slack, hard)
                    candidates[0, 0] = (b * planes[j, 1] - d * planes[i, 1]) / cross
                    candidates[0, 1] = (d * planes[i, 0] - b * planes[j, 0]) / cross
                    tried = 1
            for k in range(tried):
                x, y = candidates[k, 0], candidates[k, 1]
                far = math.hypot(x - wanted[0], y - wanted[1])
                if far < least and _obeys(planes, x, y, top, slack, hard):
                    least, found = far, (x, y, True)
    return found


@njit(cache=True)
def nearest_velocity(
    planes: Any, wanted: Any, top: float, hard: int
) -> tuple[float, float, float]:  # pragma: no cover  (compiled)
    """Finds the permitted velocity that is nearest to a wanted velocity.

    A velocity is permitted if it lies in all half planes and does not exceed ``top``.
    If no velocity is permitted, the function moves all soft half planes outward by the
    same distance, called the slack. Bisection finds the least slack that permits a
    velocity. The hard half planes never move.

    Args:
        planes: (k, 3) half planes n . v >= offset: x and y of the unit normal n, and
            offset, m/s.
        wanted: Wanted velocity (x, y), m/s.
        top: Largest speed, m/s.
        hard: Number of hard half planes, which are the last rows of ``planes``. They
            must contain the velocity zero.

    Returns:
        Velocity x, m/s; velocity y, m/s; and slack, m/s.
    """
    x, y, obeys = _nearest(planes, wanted, top, 0.0, hard)
    if obeys:
        return x, y, 0.0
    low, high = 0.0, top
    for k in range(len(planes)):
        high = max(high, planes[k, 2] + top)
    for _ in range(_HALVINGS):
        slack = 0.5 * (low + high)
        x, y, obeys = _nearest(planes, wanted, top, slack, hard)
        if obeys:
            high = slack
        else:
            low = slack
    x, y, obeys = _nearest(planes, wanted, top, high, hard)
    return x, y, high
