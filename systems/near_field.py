"""Range and bearing of a source from the delays at three microphones in a row.

M1, M2 and M3 stand at y = l, 0, -l; the source lies ahead, x > 0. With
a = c tau_12 and b = c tau_13, where tau_ij = t_j - t_i, Apollonius' theorem
gives R1 = (2 l^2 + 2 a^2 - b^2) / (2 (b - 2 a)) (Kim 2017, eq. 8; eq. 9 of
Han 2019 is not consistent with its own eq. 7), R2 = R1 + a, R3 = R1 + b and
sin(bearing) = (R3^2 - R1^2) / (4 l R2), exact at any distance.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from systems.source_fix import SourceFix

__all__ = ["locate_source", "source_from_delays"]

# Below this b - 2a is zero to rounding: the range is l^2 / (b - 2a) and more.
_LEAST_GAP_M = 1e-9

# Keeps the covariance finite for a source on the line of the microphones.
_LEAST_COSINE = 1e-3


def _bearing_only(bearing: float, bearing_std: float) -> SourceFix:
    sine, cosine = math.sin(bearing), math.cos(bearing)
    across = np.array([-sine, cosine])
    return SourceFix(
        bearing=bearing,
        bearing_std=bearing_std,
        elevation=None,
        elevation_std=None,
        range=0.0,
        range_valid=False,
        range_std=math.inf,
        p_AS=np.array([cosine, sine]),
        covariance=bearing_std**2 * np.outer(across, across),
    )


def _ranges(a: float, b: float, spacing: float) -> tuple[float, float, float] | None:
    """R1, R2, R3 in m, or None where the delays have no finite range."""
    if b - 2.0 * a <= _LEAST_GAP_M:
        return None
    r1 = (2.0 * spacing**2 + 2.0 * a * a - b * b) / (2.0 * (b - 2.0 * a))
    r2, r3 = r1 + a, r1 + b
    if min(r1, r2, r3) <= 0.0 or abs(r3 * r3 - r1 * r1) > 4.0 * spacing * r2:
        return None
    return r1, r2, r3


def source_from_delays(
    tau_12: float, tau_13: float, spacing: float, c: float
) -> tuple[float, float, bool]:
    """Bearing and range of the source from M2.

    Args:
        tau_12: Time by which the sound reaches M2 later than M1, s.
        tau_13: Time by which the sound reaches M3 later than M1, s.
        spacing: Distance l between neighbouring microphones, m.
        c: Speed of sound, m/s.

    Returns:
        bearing in [-pi/2, pi/2] (rad, left positive), range (m) and whether
        the range is valid. If not, the range is 0 and the bearing is that of
        a source far away.
    """
    a, b = c * tau_12, c * tau_13
    ranges = _ranges(a, b, spacing)
    if ranges is None:
        return math.asin(min(1.0, max(-1.0, b / (2.0 * spacing)))), 0.0, False
    r1, r2, r3 = ranges
    return math.asin((r3 * r3 - r1 * r1) / (4.0 * spacing * r2)), r2, True


def locate_source(
    tau_12: float,
    tau_13: float,
    covariance: NDArray[np.float64],
    spacing: float,
    c: float,
) -> SourceFix:
    """As ``source_from_delays``, with what the delays' errors make of it.

    Args:
        tau_12: Delay, s.
        tau_13: Delay, s.
        covariance: (2, 2) of the two delays, s^2.
        spacing: Distance between neighbouring microphones, m.
        c: Speed of sound, m/s.

    Returns:
        The source in axes (ahead, left) at M2.
    """
    bearing, r2, valid = source_from_delays(tau_12, tau_13, spacing, c)
    sine, cosine = math.sin(bearing), math.cos(bearing)
    safe = max(cosine, _LEAST_COSINE)
    if not valid:
        to_bearing = np.array([0.0, c / (2.0 * spacing * safe)])
        return _bearing_only(bearing, math.sqrt(to_bearing @ covariance @ to_bearing))
    a, b = c * tau_12, c * tau_13
    r1, r3 = r2 - a, r2 - a + b
    gap = b - 2.0 * a
    # Rows: what the two delays' errors do to range, bearing, x and y.
    slopes = np.empty((4, 2))
    slopes[0] = c * (r1 + r3) / gap, -c * r3 / gap
    to_y = c * b * r2 / (spacing * gap), -c * a * r3 / (spacing * gap)
    slopes[1] = (to_y - sine * slopes[0]) / (r2 * safe)
    slopes[2] = cosine * slopes[0] - r2 * sine * slopes[1]
    slopes[3] = sine * slopes[0] + r2 * cosine * slopes[1]
    errors = slopes @ covariance @ slopes.T
    return SourceFix(
        bearing=bearing,
        bearing_std=math.sqrt(errors[1, 1]),
        elevation=None,
        elevation_std=None,
        range=r2,
        range_valid=True,
        range_std=math.sqrt(errors[0, 0]),
        p_AS=np.array([r2 * cosine, r2 * sine]),
        covariance=errors[2:, 2:],
    )
