"""Computes range and bearing of a source from the delays at three microphones in a row.

The microphones M1, M2 and M3 are at y = l, 0, -l, and the source is ahead, at x > 0.
R_i is the distance from the source to M_i. The delay tau_ij = t_j - t_i is the time by
which the sound reaches M_j later than M_i. Let a = c tau_12 and b = c tau_13, where c
is the speed of sound. The module uses these equations, which are exact at any distance:

- R1 = (2 l^2 + 2 a^2 - b^2) / (2 (b - 2 a)), from Apollonius' theorem (Kim 2017, eq.
  8);
- R2 = R1 + a and R3 = R1 + b;
- sin(bearing) = (R3^2 - R1^2) / (4 l R2).

Han 2019 prints another equation for the range (eq. 9). It does not follow from eq. 7
and 8 of that paper (docs/errata.md), so this module does not use it.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from systems.framework.compiling import njit
from systems.hearing.delay_fit import carried
from systems.hearing.source_fix import RANGED, SourceFix, range_status
from systems.sound.array_shape import EqualRow

# Limit of b - 2 a. If b - 2 a is at most this, it consists mainly of rounding errors.
# It then counts as zero, and the wave is a plane wave.
_LEAST_GAP_M = 1e-9

#: Least cosine that keeps errors finite for a source on the line of the microphones, or
#: straight above an array.
LEAST_COSINE = 1e-3


@njit(cache=True)
def _ranges(
    a: float, b: float, spacing: float
) -> tuple[int, float, float, float]:  # pragma: no cover  (compiled)
    """Returns the status of the range, and R1, R2, R3 in m."""
    if b - 2.0 * a <= _LEAST_GAP_M:
        return range_status(0.0), 0.0, 0.0, 0.0
    r1 = (2.0 * spacing**2 + 2.0 * a * a - b * b) / (2.0 * (b - 2.0 * a))
    r2, r3 = r1 + a, r1 + b
    valid = min(r1, r2, r3) > 0.0 and abs(r3 * r3 - r1 * r1) <= 4.0 * spacing * r2
    return range_status(1.0 / r2 if valid else np.nan), r1, r2, r3


@njit(cache=True)
def source_from_delays(
    tau_12: float, tau_13: float, spacing: float, c: float
) -> tuple[float, float, int]:  # pragma: no cover  (compiled)
    """Computes bearing and range of a source seen from the middle of three microphones.

    The microphones M1, M2 and M3 form a row from left to right.

    Args:
        tau_12: Time by which the sound reaches M2 later than M1, s.
        tau_13: Time by which the sound reaches M3 later than M1, s.
        spacing: Distance between adjacent microphones, m.
        c: Speed of sound, m/s.

    Returns:
        Three values: bearing in [-pi/2, pi/2], rad, positive to the left; range, m; and
        status of the range (``range_status``). Without a range, the second value is 0,
        and the bearing is that of a source far away.
    """
    a, b = c * tau_12, c * tau_13
    status, r1, r2, r3 = _ranges(a, b, spacing)
    if status != RANGED:
        return math.asin(min(1.0, max(-1.0, b / (2.0 * spacing)))), 0.0, status
    return math.asin((r3 * r3 - r1 * r1) / (4.0 * spacing * r2)), r2, status


@njit(cache=True)
def _slopes(
    bearing: float, r2: float, a: float, b: float, spacing: float, c: float
) -> NDArray[np.float64]:  # pragma: no cover  (compiled)
    """Computes the (4, 2) derivatives of range, bearing, x and y of the source.

    The derivatives are with respect to the delays tau_12 and tau_13. The delay tau_1j
    is the time by which the sound reaches microphone j later than microphone 1.
    """
    sine, cosine = math.sin(bearing), math.cos(bearing)
    r1, r3 = r2 - a, r2 - a + b
    gap = b - 2.0 * a
    to_range = np.array([c * (r1 + r3) / gap, -c * r3 / gap])
    to_y = np.array([c * b * r2, -c * a * r3]) / (spacing * gap)
    slopes = np.empty((4, 2))
    across = r2 * max(cosine, LEAST_COSINE)
    for k in range(2):
        slopes[0, k] = to_range[k]
        slopes[1, k] = (to_y[k] - sine * to_range[k]) / across
        slopes[2, k] = cosine * to_range[k] - r2 * sine * slopes[1, k]
        slopes[3, k] = sine * to_range[k] + r2 * cosine * slopes[1, k]
    return slopes


@njit(cache=True)
def _locate(
    tau: NDArray[np.float64],
    covariance: NDArray[np.float64],
    to_delays: NDArray[np.float64],
    axes: NDArray[np.float64],
    spacing: float,
    c: float,
) -> tuple[
    NDArray[np.float64], NDArray[np.float64], float, float, int, float
]:  # pragma: no cover  (compiled)
    """Computes the position of the source in the axes of the array, with errors.

    The function returns the position; its covariance; the standard deviation of the
    bearing; the range; the status of the range; and the standard deviation of the
    range.
    """
    tau_12 = to_delays[0, 0] * tau[0] + to_delays[0, 1] * tau[1]
    tau_13 = to_delays[1, 0] * tau[0] + to_delays[1, 1] * tau[1]
    of_delays = carried(to_delays, covariance, 2)
    bearing, r2, status = source_from_delays(tau_12, tau_13, spacing, c)
    sine, cosine = math.sin(bearing), math.cos(bearing)
    if status == RANGED:
        slopes = _slopes(bearing, r2, c * tau_12, c * tau_13, spacing, c)
        place = np.array([r2 * cosine, r2 * sine])
    else:
        turn = c / (2.0 * spacing * max(cosine, LEAST_COSINE))
        slopes = np.zeros((4, 2))
        slopes[1, 1], slopes[2, 1], slopes[3, 1] = turn, -turn * sine, turn * cosine
        place = np.array([cosine, sine])
    errors = carried(slopes, of_delays, 2)
    p_AS = np.zeros(axes.shape[0])
    for k in range(2):
        p_AS += axes[:, k] * place[k]
    range_std = math.sqrt(errors[0, 0]) if status == RANGED else np.inf
    of_p = carried(axes, errors[2:, 2:], 2)
    return p_AS, of_p, math.sqrt(errors[1, 1]), r2, status, range_std


def locate_in_row(
    tau: NDArray[np.float64],
    covariance: NDArray[np.float64],
    row: EqualRow,
    c: float,
) -> SourceFix:
    """Locates a source by ``source_from_delays``, and computes the errors.

    Args:
        tau: (2,) delays of the channels 1 and 2 relative to channel 0, s.
        covariance: (2, 2) covariance of the delays, s^2.
        row: The microphones.
        c: Speed of sound, m/s.

    Returns:
        The source in the axes of the array.
    """
    p_AS, of_p, bearing_std, distance, status, range_std = _locate(
        tau, covariance, row.to_delays, row.axes, row.spacing_m, c
    )
    return SourceFix(
        bearing=math.atan2(p_AS[1], p_AS[0]),
        bearing_std=bearing_std,
        elevation=None,
        elevation_std=None,
        range=distance,
        range_status=status,
        range_std=range_std,
        p_AS=p_AS,
        covariance=of_p,
    )
