"""Locates a source from range differences by spherical interpolation."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from systems.hearing.source_fix import RANGED, range_status

#: Largest range of a position, m. At larger ranges, the bearing of the plane wave is
#: better.
FARTHEST_M = 4.0
#: Largest difference between the bearings of the position and of the plane wave, deg.
AGREEMENT_DEG = 15.0


def interpolate_sphere(
    p_RM: ArrayLike, d: ArrayLike
) -> tuple[NDArray[np.float64], float]:
    """Computes the least-squares position of a source from range differences.

    See Song 2011, eq. 14 to 17, and Smith and Abel 1987.

    Args:
        p_RM: (n, k) positions of the other microphones relative to the reference
            microphone, m; k is 2 or 3. The number n is at least k + 1. With n = k + 1,
            the equations are exact.
        d: (n,) range differences, m. The range difference of a microphone is its range
            minus the range of the reference microphone.

    Returns:
        Two values: (k,) position of the source relative to the reference microphone, m,
        and its range, m. The range is negative or infinite if no position has these
        range differences.
    """
    S, d = np.asarray(p_RM, dtype=float), np.asarray(d, dtype=float)
    inverse = np.linalg.pinv(S)
    delta = np.sum(S * S, axis=1) - d * d
    left = d - S @ (inverse @ d)  # P d, which determines the range
    below = 2.0 * left @ d
    if abs(below) < 1e-15:
        return np.full(S.shape[1], np.inf), math.inf
    distance = float(left @ delta / below)
    return 0.5 * inverse @ (delta - 2.0 * distance * d), distance


def plane_wave_bearing(p_RM: ArrayLike, d: ArrayLike) -> float:
    """Computes the bearing of a source, as if the source were far away.

    Args:
        p_RM: (n, 2) positions of the other microphones relative to the reference
            microphone, m.
        d: (n,) range differences, m. The range difference of a microphone is its range
            minus the range of the reference microphone.

    Returns:
        Bearing CCW from x, rad. The bearing is never on the wrong side. For a source at
        0.25 m, its error is about 5 deg.
    """
    x, y = -np.linalg.pinv(np.asarray(p_RM, dtype=float)) @ np.asarray(d, dtype=float)
    return math.atan2(y, x)


def near_or_far(
    p_RM: ArrayLike, d: ArrayLike
) -> tuple[float, NDArray[np.float64] | None, int]:
    """Computes the bearing of a source, and its position if the position is credible.

    Errors can change the sign of the sum of the range differences. Spherical
    interpolation then turns the bearing by 180 deg. The position is therefore used only
    if its range is at most 4 m and its bearing differs by at most 15 deg from that of a
    plane wave.

    Args:
        p_RM: (n, 2) positions of the other microphones relative to the reference
            microphone, m.
        d: (n,) range differences, m. The range difference of a microphone is its range
            minus the range of the reference microphone.

    Returns:
        Three values: bearing, rad; (2,) position relative to the reference microphone,
        m, or None if it is not credible; and status of the range (``range_status``).
    """
    plane = plane_wave_bearing(p_RM, d)
    place, distance = interpolate_sphere(p_RM, d)
    bearing, off = plane, 0.0
    if distance < math.inf:
        bearing = math.atan2(place[1], place[0])
        off = math.remainder(bearing - plane, 2.0 * math.pi)
    inverse_range = math.nan if distance <= 0.0 else 0.0
    if 0.0 < distance < FARTHEST_M:
        inverse_range = 1.0 / distance
    status = range_status(inverse_range, abs(off), math.radians(AGREEMENT_DEG))
    return (bearing, place, status) if status == RANGED else (plane, None, status)
