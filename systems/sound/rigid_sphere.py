"""Delays of sound at microphones on a rigid sphere.

A plane wave from the direction u reaches a microphone at the angle t from u. In free
air, it arrives at the time -a cos(t) / c, where a is the radius and c the speed of
sound. On the sphere, the phase is that of the series of a scattered plane wave:

    p(t) = i / (ka)^2 sum_n (2 n + 1) i^n P_n(-cos t) / h_n'(ka).

At low frequencies, the arrival is 1.5 times as far from 0 as in free air. At high
frequencies, it is the arrival in free air on the lit side; on the dark side, the wave
creeps along the sphere and arrives a (t - pi / 2) / c later than at the edge. The delay
that is measured in a band lies between these limits.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

# Angles of the table of delays.
_ANGLE = np.linspace(0.0, math.pi, 181)

# Top of the frequencies that a sound may have, as shares of the top of the band. The
# sound is not known, so its delays are the mean, and the scatter is their error.
_TOPS = (1.0, 0.5, 0.25)

# Largest step of ka, and least number of steps, from 0 to the top. The phase changes by
# at most 1.6 times the step.
_STEP, _LEAST_STEPS = 0.25, 60


@dataclass(frozen=True)
class RigidSphere:
    """A rigid sphere with n microphones on its surface, in a band of frequencies."""

    toward: NDArray[np.float64]
    """(n, d) unit vectors from the center of the sphere to the microphones."""
    radius_m: float
    """Radius of the sphere, m."""
    band_hz: tuple[float, float]
    """Lowest and highest frequency of the sound, Hz."""
    c: float
    """Speed of sound, m/s."""

    @cached_property
    def _each(self) -> NDArray[np.float64]:
        low, high = (2.0 * math.pi * f * self.radius_m / self.c for f in self.band_hz)
        return _arrivals(low, high)

    @cached_property
    def _arrivals(self) -> NDArray[np.float64]:
        return np.asarray(self._each.mean(axis=0))

    @property
    def scale(self) -> float:
        """Distance of the microphones from the center in free air that fits best.

        The distance is a multiple of the radius. It is between 1.2 and 1.6.
        """
        return float(_scales(self._arrivals))

    @property
    def scale_std(self) -> float:
        """Standard deviation of ``scale`` over its value, as the sound is not known."""
        return float(np.std(_scales(self._each))) / self.scale

    @property
    def arrival_std_s(self) -> float:
        """Standard deviation of an arrival besides that of ``scale``, s."""
        free = np.outer(_scales(self._each), np.cos(_ANGLE))
        variance = np.average((self._each + free).var(axis=0), weights=np.sin(_ANGLE))
        return math.sqrt(variance) * self.radius_m / self.c

    @property
    def bend_std_m(self) -> float:
        """Root mean square of the path that free air at ``scale`` leaves out, m."""
        bend = self._bend(np.cos(_ANGLE))
        return self.radius_m * math.sqrt(np.average(bend**2, weights=np.sin(_ANGLE)))

    def later(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Computes how much later sound arrives than in free air at ``scale``, s.

        The (..., d) unit vectors point to the sources. The result has the shape
        (..., n).
        """
        return self._bend(u @ self.toward.T) * self.radius_m / self.c

    def _bend(self, cosine: NDArray[np.float64]) -> NDArray[np.float64]:
        angle = np.arccos(np.clip(cosine, -1.0, 1.0))
        at = np.interp(angle, _ANGLE, self._arrivals)
        return np.asarray(at + self.scale * cosine, dtype=np.float64)


def _scales(arrivals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Fits the distance in free air to (..., m) arrivals at the angles of the table."""
    weights = np.sin(_ANGLE) * np.cos(_ANGLE)
    return np.asarray(-(arrivals @ weights) / (weights @ np.cos(_ANGLE)))


@lru_cache(maxsize=16)
def _arrivals(low: float, high: float) -> NDArray[np.float64]:
    """Computes tables of arrivals for several sounds, as multiples of a / c.

    The arguments are 2 pi f a / c for the lowest and highest frequency f.
    """
    tops = [max(share * high, low) for share in _TOPS]
    return np.array([_arrivals_up_to(low, top) for top in tops])


def _arrivals_up_to(low: float, high: float) -> NDArray[np.float64]:
    """Computes the delays at which all frequencies agree best, for equal weights."""
    ka = np.linspace(0.0, high, max(math.ceil(high / _STEP), _LEAST_STEPS) + 1)[1:]
    phase = np.unwrap(np.angle(surface_pressure(ka, _ANGLE)), axis=0)
    ka, phase = ka[ka >= low], phase[ka >= low]
    return np.asarray(ka @ phase / (ka @ ka))


def surface_pressure(
    ka: NDArray[np.float64], angle: NDArray[np.float64]
) -> NDArray[np.complex128]:
    """Computes the pressure on the sphere over that of the wave at its center.

    The (f,) values ``ka`` are 2 pi f a / c, and the (m,) angles are those between
    microphone and source, rad. The phase of the (f, m) result is the angular frequency
    times the arrival time.
    """
    # Geometries with a sphere are read, and refused, before scipy is loaded.
    from scipy.special import eval_legendre, spherical_jn, spherical_yn

    n = np.arange(math.ceil(1.3 * float(ka.max()) + 12.0))[:, np.newaxis]
    slope = np.empty((len(n), len(ka)), dtype=np.complex128)
    slope.real = spherical_jn(n, ka, derivative=True)
    slope.imag = spherical_yn(n, ka, derivative=True)
    # The slope overflows at high orders, which then have no part in the sum.
    finite = np.isfinite(slope.imag)
    factor = np.broadcast_to(1j ** (n % 4) * (2 * n + 1), slope.shape)
    waves = np.divide(factor, slope, out=np.zeros_like(slope), where=finite)
    sums = waves.T @ eval_legendre(n, -np.cos(angle))
    return np.asarray((1j / ka**2)[:, np.newaxis] * sums)
