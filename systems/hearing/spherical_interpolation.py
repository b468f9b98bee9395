"""Place of a source from differences of range, by spherical interpolation."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

#: Places farther than this are none: the plane wave's bearing is better, m.
FARTHEST_M = 4.0
#: A place counts if its bearing is this near to that of the plane wave, deg.
AGREEMENT_DEG = 15.0


def interpolate_sphere(
    p_RM: ArrayLike, d: ArrayLike
) -> tuple[NDArray[np.float64], float]:
    """Least-squares place of a source (Song 2011, eq. 14 to 17; Smith, Abel 1987).

    Args:
        p_RM: (n, k) microphones from the reference one, m; n at least k + 1, or k = 2
            with three of them, for which the equations are exact.
        d: (n,) range of the source from each less that from the reference one, m.

    Returns:
        (k,) the source from the reference microphone, m, and its range, m, which is
        negative or infinite where the differences fit no place.
    """
    S, d = np.asarray(p_RM, dtype=float), np.asarray(d, dtype=float)
    inverse = np.linalg.pinv(S)
    delta = np.sum(S * S, axis=1) - d * d
    left = d - S @ (inverse @ d)  # P d, by which the range is told
    below = 2.0 * left @ d
    if abs(below) < 1e-15:
        return np.full(S.shape[1], np.inf), math.inf
    distance = float(left @ delta / below)
    return 0.5 * inverse @ (delta - 2.0 * distance * d), distance


def plane_wave_bearing(p_RM: ArrayLike, d: ArrayLike) -> float:
    """Bearing of a source far away.

    Args:
        p_RM: (n, 2) microphones from the reference one, m.
        d: (n,) differences of range, m.

    Returns:
        CCW from x, rad; never on the wrong side, near sources 5 deg off at 0.25 m.
    """
    x, y = -np.linalg.pinv(np.asarray(p_RM, dtype=float)) @ np.asarray(d, dtype=float)
    return math.atan2(y, x)


def near_or_far(
    p_RM: ArrayLike, d: ArrayLike
) -> tuple[float, NDArray[np.float64] | None]:
    """Bearing, and the place where one can be believed.

    Spherical interpolation turns by 180 deg where errors change the sign of the sum of
    the differences; so its place counts only within 4 m and 15 deg of the plane wave.

    Args:
        p_RM: (n, 2) microphones from the reference one, m.
        d: (n,) differences of range, m.

    Returns:
        Bearing, rad, and (2,) the place from the reference microphone, m, or None.
    """
    plane = plane_wave_bearing(p_RM, d)
    place, distance = interpolate_sphere(p_RM, d)
    if not 0.0 < distance < FARTHEST_M:
        return plane, None
    bearing = math.atan2(place[1], place[0])
    off = math.remainder(bearing - plane, 2.0 * math.pi)
    if abs(off) > math.radians(AGREEMENT_DEG):
        return plane, None
    return bearing, place
