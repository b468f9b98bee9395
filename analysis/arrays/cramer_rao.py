"""The Cramer-Rao bound: the least possible localization error from a frame of sound.

Model: microphone m at distance R_m records a_m s(t - R_m / c) in white Gaussian noise
of RMS sigma_m. The waveform s is deterministic and unknown. The gains a_m = 1 / R_m are
known.

The bound ignores the information in the sound levels. With channels that are equal to
within a few thousandths, levels would add a tenth of the information on range at 60
deg, and next to nothing straight ahead. Real channels differ by more.

A stretch of sound that a set of microphones records carries this Fisher information on
the arrival times at the set:

    rate * integral of s'^2 dt * (diag(g) - g g^T / sum g),   g_m = (a_m / sigma_m)^2

Here, s' is the slope of the sound, and ``rate`` is the sample rate. The second term is
the loss due to the unknown waveform. A frame contains a different stretch of the sound
at each microphone. Each stretch counts only for the microphones that recorded it. A
stretch that only one microphone recorded has no information. For two microphones and a
strong signal, the bound equals that of Knapp and Carter (1976).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import fft

# Beyond this condition number, the delays do not determine a position.
_LARGEST_CONDITION = 1e14


@dataclass(frozen=True)
class SlopeEnergy:
    """Integral of the squared slope of a sound, up to each of its samples."""

    integral: NDArray[np.float64]
    """(n + 1,) ascending from 0, Pa^2/s at 1 m."""
    start_time: float
    """Time at which the first sample left the source, s."""
    sample_rate_hz: float
    """Rate of the samples, Hz."""

    @classmethod
    def of(
        cls, samples: ArrayLike, sample_rate_hz: float, start_time: float = 0.0
    ) -> SlopeEnergy:
        """Integrates the squared slope of a sound, from its (n,) samples in Pa at 1 m.

        The slope is that of the band-limited signal through the samples. The samples
        should begin and end near zero, or form a full period. The first sample leaves
        the source at ``start_time``, s.
        """
        x = np.asarray(samples, dtype=float)
        omega = 2.0 * math.pi * sample_rate_hz * fft.rfftfreq(len(x))
        slope = fft.irfft(1j * omega * fft.rfft(x), len(x))
        integral = np.concatenate(([0.0], np.cumsum(slope**2) / sample_rate_hz))
        return cls(integral, start_time, sample_rate_hz)

    def before(self, times: ArrayLike) -> NDArray[np.float64]:
        """Integral of the squared slope that left the source before ``times`` in s."""
        last = len(self.integral) - 1
        place = (np.asarray(times) - self.start_time) * self.sample_rate_hz
        place = np.clip(place, 0.0, last)
        # numpy.interp would read all samples of the sound at each call.
        sample = np.minimum(place.astype(int), last - 1)
        step = self.integral[sample + 1] - self.integral[sample]
        return self.integral[sample] + (place - sample) * step


@dataclass(frozen=True)
class LocalizationBound:
    """Least standard deviations of an unbiased position estimate from a frame of sound.

    If the frame has no information on a quantity, its standard deviation is infinite.
    """

    delays: NDArray[np.float64]
    """(n - 1, n - 1) covariance of the delays t_k - t_0, s^2."""
    covariance: NDArray[np.float64]
    """(d, d) covariance of the position, m^2."""
    bearing_std: float
    """Standard deviation of the bearing, rad."""
    elevation_std: float | None
    """Standard deviation of the elevation, rad; None in the plane."""
    range_std: float
    """Standard deviation of the range, m."""

    @classmethod
    def mean(cls, bounds: Sequence[LocalizationBound]) -> LocalizationBound:
        """Averages the variances and covariances of the bounds of many frames."""
        elevations = [b.elevation_std for b in bounds if b.elevation_std is not None]
        return cls(
            delays=np.mean([b.delays for b in bounds], axis=0),
            covariance=np.mean([b.covariance for b in bounds], axis=0),
            bearing_std=_rms([b.bearing_std for b in bounds]),
            elevation_std=_rms(elevations) if elevations else None,
            range_std=_rms([b.range_std for b in bounds]),
        )


def arrival_information(
    energy: SlopeEnergy, begin: float, end: float, travel: ArrayLike, weights: ArrayLike
) -> NDArray[np.float64]:
    """Computes the Fisher information of a frame on the arrival times of its sound.

    The frame lasts from its first sample at ``begin`` to one sample after its last at
    ``end``. ``travel`` has the (n,) travel times to the microphones. ``weights`` has
    the (n,) products of the sample rate and g_m from the module docstring, 1/(Pa^2 s).
    The result is (n, n), 1/s^2. A common shift of all times has no information.
    """
    travel, weights = np.asarray(travel), np.asarray(weights)
    edges = np.sort(np.concatenate((begin - travel, end - travel)))
    left = energy.before(edges)
    middle = 0.5 * (edges[:-1] + edges[1:])[:, np.newaxis] + travel
    g = np.where((middle >= begin) & (middle < end), weights, 0.0)
    total = g.sum(axis=1)
    known = total > 0.0
    g, heard = g[known], np.diff(left)[known]
    lost = g[:, :, np.newaxis] * g[:, np.newaxis] / total[known, np.newaxis, np.newaxis]
    each = g[:, :, np.newaxis] * np.eye(len(travel)) - lost
    return np.asarray((heard[:, np.newaxis, np.newaxis] * each).sum(axis=0))


def position_bound(
    energy: SlopeEnergy,
    begin: float,
    end: float,
    p_AS: ArrayLike,
    p_AM: ArrayLike,
    noise_pa: ArrayLike,
    *,
    sample_rate_hz: float,
    c: float,
) -> LocalizationBound:
    """Computes the Cramer-Rao bound of a source's position from one frame.

    Source and microphones are at rest, at (d,) p_AS and (n, d) p_AM, m. The frame lasts
    from its first sample at ``begin`` to one sample after its last at ``end``, s.
    ``noise_pa`` is the RMS of the noise from 0 to half the sample rate, either (n,), or
    one value for all channels. Bearing and range are seen from the origin, which should
    be the microphones' centroid. If the frame does not determine the position, the
    covariances and standard deviations are infinite.
    """
    p_AS, p_AM = np.asarray(p_AS, dtype=float), np.asarray(p_AM, dtype=float)
    rays = p_AS - p_AM
    ranges = np.linalg.norm(rays, axis=1)
    weights = sample_rate_hz / (ranges * np.asarray(noise_pa)) ** 2
    information = arrival_information(energy, begin, end, ranges / c, weights)
    to_times = rays / ranges[:, None] / c
    delays = _inverse(information[1:, 1:])
    covariance = _inverse(to_times.T @ information @ to_times)
    if not np.isfinite(covariance).all():
        elevation = None if len(p_AS) == 2 else math.inf
        return LocalizationBound(delays, covariance, math.inf, elevation, math.inf)
    stds = [math.sqrt(g @ covariance @ g) for g in polar_gradients(p_AS)]
    return LocalizationBound(
        delays, covariance, stds[0], stds[2] if len(stds) > 2 else None, stds[1]
    )


def _rms(values: Sequence[float]) -> float:
    return math.sqrt(np.mean(np.square(values)))


def _inverse(information: NDArray[np.float64]) -> NDArray[np.float64]:
    """Inverse of a matrix; infinite if the matrix is nearly singular."""
    if np.linalg.cond(information) > _LARGEST_CONDITION:
        return np.full(information.shape, math.inf)
    return np.asarray(np.linalg.inv(information))


def polar_point(range_m: float, bearing_deg: float) -> NDArray[np.float64]:
    """Converts range and bearing from the x axis to a (2,) point in the plane, m."""
    angle = math.radians(bearing_deg)
    return range_m * np.array([math.cos(angle), math.sin(angle)])


def polar_gradients(p: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Gradients of azimuth, range and, in 3D, elevation along the position."""
    distance = float(np.linalg.norm(p))
    flat = math.hypot(p[0], p[1])
    around = np.zeros(len(p))
    around[:2] = np.array([-p[1], p[0]]) / flat**2
    gradients = [around, p / distance]
    if len(p) == 3:
        up = np.array([-p[0] * p[2] / flat, -p[1] * p[2] / flat, flat])
        gradients.append(up / distance**2)
    return gradients
