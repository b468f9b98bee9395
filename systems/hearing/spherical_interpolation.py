"""Place of a source from differences of range, by spherical interpolation."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from systems.hearing.source_fix import RANGED, range_status

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
    left = d - S @ (inverse @ d)  # P d, by which the range is known
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
) -> tuple[float, NDArray[np.float64] | None, int]:
    """Bearing, and the place where one can be believed.

    Spherical interpolation turns by 180 deg where errors change the sign of the sum of
    the differences; so its place counts only within 4 m and 15 deg of the plane wave.

    Args:
        p_RM: (n, 2) microphones from the reference one, m.
        d: (n,) differences of range, m.

    Returns:
        Bearing, rad, (2,) the place from the reference microphone, m, or None, and the
        status of the range (``range_status``).
    """
    plane = plane_wave_bearing(p_RM, d)
    place, distance = interpolate_sphere(p_RM, d)
    bearing, off = plane, 0.0
    if distance < math.inf:
        bearing = math.atan2(place[1], place[0])
        off = math.remainder(bearing - plane, 2.0 * math.pi)
    inverse_range = inverse_of(distance if distance < FARTHEST_M else math.inf)
    status = range_status(inverse_range, abs(off), math.radians(AGREEMENT_DEG))
    return (bearing, place, status) if status == RANGED else (plane, None, status)


def inverse_of(distance: float) -> float:
    """The inverse of a range of ``interpolate_sphere``, as ``range_status`` takes it.

    Args:
        distance: m; 0 or less where no place fits.

    Returns:
        1/m; 0 for a plane wave, NaN where no place fits.
    """
    return 1.0 / distance if distance > 0.0 else math.nan
