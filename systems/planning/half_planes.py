"""The velocity nearest to a wanted one that obeys half planes and a top speed."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

__all__ = ["nearest_velocity"]

#: Rounding of a constraint, m/s.
_ROUNDING = 1e-9
#: Halvings in which the least slack is found.
_HALVINGS = 40


@njit(cache=True)
def _obeys(
    planes: Any, x: float, y: float, top: float, slack: float
) -> bool:  # pragma: no cover  (compiled)
    if x * x + y * y > (top + _ROUNDING) ** 2:
        return False
    for k in range(len(planes)):
        if planes[k, 0] * x + planes[k, 1] * y < planes[k, 2] - slack - _ROUNDING:
            return False
    return True


@njit(cache=True)
def _nearest(
    planes: Any, wanted: Any, top: float, slack: float
) -> tuple[float, float, bool]:  # pragma: no cover  (compiled)
    """The nearest one with planes moved back by a slack, and whether there is one.

    The optimum of so small a problem is the wanted one, its projection on a border, or
    where two borders cross: all are tried.
    """
    count = len(planes)
    found = 0.0, 0.0, False
    least = np.inf
    candidates = np.empty((4, 2))
    speed = math.hypot(wanted[0], wanted[1])
    for i in range(-1, count + 1):
        for j in range(-1, i) if i > 0 else range(-1, 0):
            tried = 0
            if i < 0:
                candidates[0, 0], candidates[0, 1], tried = wanted[0], wanted[1], 1
            elif i == count and j < 0:
                # On the circle of the top speed.
                part = top / speed if speed > 0.0 else 0.0
                candidates[0, 0], candidates[0, 1] = part * wanted[0], part * wanted[1]
                tried = 1
            elif i == count:
                n0, n1, b = planes[j, 0], planes[j, 1], planes[j, 2] - slack
                if abs(b) <= top:
                    along = math.sqrt(top * top - b * b)
                    for sign in (1.0, -1.0):
                        candidates[tried, 0] = n0 * b - sign * n1 * along
                        candidates[tried, 1] = n1 * b + sign * n0 * along
                        tried += 1
            elif j < 0:
                n0, n1, b = planes[i, 0], planes[i, 1], planes[i, 2] - slack
                to = b - n0 * wanted[0] - n1 * wanted[1]
                candidates[0, 0] = wanted[0] + to * n0
                candidates[0, 1] = wanted[1] + to * n1
                tried = 1
            else:
                cross = planes[i, 0] * planes[j, 1] - planes[i, 1] * planes[j, 0]
                if abs(cross) > 1e-9:
                    b, d = planes[i, 2] - slack, planes[j, 2] - slack
                    candidates[0, 0] = (b * planes[j, 1] - d * planes[i, 1]) / cross
                    candidates[0, 1] = (d * planes[i, 0] - b * planes[j, 0]) / cross
                    tried = 1
            for k in range(tried):
                x, y = candidates[k, 0], candidates[k, 1]
                far = math.hypot(x - wanted[0], y - wanted[1])
                if far < least and _obeys(planes, x, y, top, slack):
                    least, found = far, (x, y, True)
    return found


@njit(cache=True)
def nearest_velocity(
    planes: Any, wanted: Any, top: float
) -> tuple[float, float]:  # pragma: no cover  (compiled)
    """The velocity nearest to a wanted one that obeys all half planes.

    Where none does, all planes are moved back by the least distance with which one
    does: the worst is broken by least.

    Args:
        planes: (n, 3) unit normal x, y and offset, m/s, of n . v >= offset.
        wanted: (x, y) m/s.
        top: Largest speed, m/s.

    Returns:
        (x, y) m/s.
    """
    x, y, obeys = _nearest(planes, wanted, top, 0.0)
    if obeys:
        return x, y
    low, high = 0.0, top
    for k in range(len(planes)):
        high = max(high, planes[k, 2] + top)
    for _ in range(_HALVINGS):
        slack = 0.5 * (low + high)
        x, y, obeys = _nearest(planes, wanted, top, slack)
        if obeys:
            high = slack
        else:
            low = slack
    x, y, obeys = _nearest(planes, wanted, top, high)
    return x, y
