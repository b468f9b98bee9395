"""Recordings of microphones on a rigid sphere, by the series of a scattered wave."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from systems.sound.rigid_sphere import surface_pressure

# Number of values of ka between which the response is interpolated.
_VALUES = 500


def spiral_sphere(count: int) -> NDArray[np.float64]:
    """Returns (count, 3) unit vectors that cover a sphere evenly."""
    k = np.arange(count)
    height = 1.0 - (2.0 * k + 1.0) / count
    azimuth = math.pi * (1.0 + math.sqrt(5.0)) * k
    level = np.sqrt(1.0 - height**2)
    return np.stack((level * np.cos(azimuth), level * np.sin(azimuth), height), axis=1)


def sphere_recording(
    toward: NDArray[np.float64],
    radius_m: float,
    u: NDArray[np.float64],
    sound: NDArray[np.float64],
    sample_rate_hz: float,
    *,
    c: float,
    snr_db: float,
    rng: np.random.Generator,
) -> NDArray[np.float64]:
    """Simulates microphones on a rigid sphere in a plane wave.

    Args:
        toward: (n, 3) unit vectors from the center to the microphones.
        radius_m: Radius of the sphere, m.
        u: (3,) unit vector to the source.
        sound: (samples,) sound of the source.
        sample_rate_hz: Rate of the samples, Hz.
        c: Speed of sound, m/s.
        snr_db: Level of the sound over independent white noise, dB.
        rng: Generator that draws the noise.

    Returns:
        (n, samples) samples.
    """
    size = 2 * len(sound)
    ka = 2.0 * math.pi * np.fft.rfftfreq(size, 1.0 / sample_rate_hz) * radius_m / c
    angle = np.arccos(np.clip(toward @ u, -1.0, 1.0))
    known = np.linspace(1e-3, ka[-1], _VALUES)
    pressure = surface_pressure(known, angle)
    level, phase = np.abs(pressure), np.unwrap(np.angle(pressure), axis=0)
    response = np.stack(
        [
            np.interp(ka, known, row) * np.exp(-1j * np.interp(ka, known, turn))
            for row, turn in zip(level.T, phase.T, strict=True)
        ]
    )
    heard = np.fft.irfft(np.fft.rfft(sound, size) * response, size)[:, : len(sound)]
    noise = heard.std() * 10.0 ** (-snr_db / 20.0)
    return np.asarray(heard + noise * rng.standard_normal(heard.shape))
