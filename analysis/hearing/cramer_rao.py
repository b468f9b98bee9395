"""The Cramer-Rao bound: how well a frame of sound can be located at best.

Model: microphone m records a_m s(t - R_m / c) in white Gaussian noise. The
waveform s is deterministic and unknown, the gains a_m = 1 / R_m are known, and
what levels tell about the position is left out: channels equal to a few
thousandths would add a tenth of the information on range at 60 deg, and next to
nothing ahead, but real ones differ by more. With the slope s' of the sound, a
stretch that all microphones of a set heard informs about their times
of arrival by

    rate * integral of s'^2 dt * (diag(g) - g g^T / sum g),   g_m = (a_m / sigma_m)^2

where the second term is what the unknown waveform takes away. Microphones cut
different stretches from the sound: each stretch counts for those that heard
it, and what one alone heard counts nothing. For two microphones and much
signal this is the bound of Knapp and Carter (1976).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import fft

# Beyond this condition number a position cannot be told from the delays.
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
        """Of samples of the sound pressure at 1 m.

        The slope is that of the band-limited signal through the samples, which
        should begin and end near zero or fit together as a period.

        Args:
            samples: (n,) Pa.
            sample_rate_hz: Their rate, Hz.
            start_time: Time at which the first one left the source, s.

        Returns:
            Integral of the squared slope up to each sample, Pa^2/s.
        """
        x = np.asarray(samples, dtype=float)
        omega = 2.0 * math.pi * sample_rate_hz * fft.rfftfreq(len(x))
        slope = fft.irfft(1j * omega * fft.rfft(x), len(x))
        integral = np.concatenate(([0.0], np.cumsum(slope**2) / sample_rate_hz))
        return cls(integral, start_time, sample_rate_hz)

    def before(self, times: ArrayLike) -> NDArray[np.float64]:
        """What had left the source before times in s."""
        last = len(self.integral) - 1
        place = (np.asarray(times) - self.start_time) * self.sample_rate_hz
        place = np.clip(place, 0.0, last)
        # numpy.interp would look at all samples of the sound each time.
        sample = np.minimum(place.astype(int), last - 1)
        step = self.integral[sample + 1] - self.integral[sample]
        return self.integral[sample] + (place - sample) * step


@dataclass(frozen=True)
class LocalizationBound:
    """Least standard deviations of an unbiased estimate from one frame.

    Infinite where the frame holds no information.
    """

    delays: NDArray[np.float64]
    """(n - 1, n - 1) covariance of t_k - t_0, s^2."""
    covariance: NDArray[np.float64]
    """(d, d) of the position, m^2."""
    bearing_std: float
    """rad."""
    elevation_std: float | None
    """rad; None in the plane."""
    range_std: float
    """m."""

    @classmethod
    def mean(cls, bounds: Sequence[LocalizationBound]) -> LocalizationBound:
        """Of errors over many frames: variances and covariances averaged."""
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
    """Fisher information of a frame on the times of arrival.

    Args:
        energy: Of the sound.
        begin: Time of the frame's first sample, s.
        end: Time one sample past its last one, s.
        travel: (n,) travelling times to the microphones, s.
        weights: (n,) g_m of the module's text times the sample rate, in
            1/(Pa^2 s).

    Returns:
        (n, n), 1/s^2; a shift of all times together is not informed about.
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
    """The bound for a resting source and resting microphones.

    Args:
        energy: Of the sound.
        begin: Time of the frame's first sample, s.
        end: Time one sample past its last one, s.
        p_AS: (d,) source, m; bearing and range are seen from the origin, which
            should be the microphones' centroid.
        p_AM: (n, d) microphones, m.
        noise_pa: RMS of the noise, from 0 to half the sample rate, in every
            channel or one for all, Pa.
        sample_rate_hz: Of the microphones, Hz.
        c: Speed of sound, m/s.

    Returns:
        Least covariances and standard deviations; infinite where nothing is known.
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
    """The inverse; infinite where there is none."""
    if np.linalg.cond(information) > _LARGEST_CONDITION:
        return np.full(information.shape, math.inf)
    return np.asarray(np.linalg.inv(information))


def polar_point(range_m: float, bearing_deg: float) -> NDArray[np.float64]:
    """A place in the plane.

    Args:
        range_m: From the origin, m.
        bearing_deg: Azimuth, deg.

    Returns:
        (2,) m.
    """
    angle = math.radians(bearing_deg)
    return range_m * np.array([math.cos(angle), math.sin(angle)])


def polar_gradients(p: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Gradients of azimuth, range and, in space, elevation."""
    distance = float(np.linalg.norm(p))
    flat = math.hypot(p[0], p[1])
    around = np.zeros(len(p))
    around[:2] = np.array([-p[1], p[0]]) / flat**2
    gradients = [around, p / distance]
    if len(p) == 3:
        up = np.array([-p[0] * p[2] / flat, -p[1] * p[2] / flat, flat])
        gradients.append(up / distance**2)
    return gradients
