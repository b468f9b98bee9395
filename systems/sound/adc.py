"""Conversion of sound pressure to counts: microphone, amplifier and converter."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from systems.framework.compiling import njit
from systems.framework.finite import check_finite
from systems.sound.parameters import MicArrayParameters


@njit(cache=True)
def _silent_counts(
    noise: NDArray[np.float32],
    gains: NDArray[np.float64],
    sigma: float,
    full_scale: np.float32,
    out: NDArray[np.int16],
) -> int:  # pragma: no cover  (compiled)
    """``_counts`` without sound pressure."""
    spoiled: Any = 0
    for m in range(noise.shape[0]):
        level = np.float32(gains[m] * sigma)
        for k in range(noise.shape[1]):
            x = np.rint(level * noise[m, k])
            spoiled |= np.int32(x - x != np.float32(0.0))
            out[m, k] = np.int16(min(max(x, -full_scale), full_scale - np.float32(1)))
    return spoiled


@njit(cache=True)
def _counts(
    pressure: NDArray[np.float32],
    noise: NDArray[np.float32],
    gains: NDArray[np.float64],
    gain: float,
    sigma: float,
    full_scale: np.float32,
    out: NDArray[np.int16],
) -> int:  # pragma: no cover  (compiled)
    """Fills ``out`` with counts; returns a nonzero number if a value is not finite."""
    spoiled: Any = 0
    for m in range(noise.shape[0]):
        factor, level = np.float32(gains[m] * gain), np.float32(gains[m] * sigma)
        for k in range(noise.shape[1]):
            x = np.rint(factor * pressure[m, k] + level * noise[m, k])
            spoiled |= np.int32(x - x != np.float32(0.0))
            out[m, k] = np.int16(min(max(x, -full_scale), full_scale - np.float32(1)))
    return spoiled


def convert(
    pressure: NDArray[np.float32] | None,
    noise: NDArray[np.float32],
    noise_pa: float,
    parameters: MicArrayParameters,
    gains: NDArray[np.float64] | None = None,
) -> NDArray[np.int16]:
    """Counts of the converter, rounded to nearest and clipped.

    Args:
        pressure: (m, n) sound pressure, Pa; None for silence.
        noise: (m, n) noise of unit variance.
        noise_pa: RMS of the noise, Pa.
        parameters: Sensitivity, gain and resolution.
        gains: (m,) true gain divided by stated gain of each channel. None: all are 1.

    Returns:
        (m, n) counts in [-2^(bits - 1), 2^(bits - 1) - 1].

    Raises:
        ValueError: Pressure, noise or a gain is not finite; the counts would not show
            this.
    """
    if gains is None:
        gains = np.ones(len(noise))
    gain = parameters.counts_per_pa
    sigma = gain * noise_pa
    full_scale = np.float32(parameters.full_scale)
    out = np.empty(noise.shape, dtype=np.int16)
    if pressure is None:
        spoiled = _silent_counts(noise, gains, sigma, full_scale, out)
    else:
        spoiled = _counts(pressure, noise, gains, gain, sigma, full_scale, out)
    if spoiled:
        _check_parts(pressure=pressure, noise=noise, gains=gains)
    return out


def _check_parts(**parts: Any) -> None:
    """Refuses arrays that are not finite."""
    for name, values in parts.items():
        if values is not None:
            check_finite(f"MicArray: {name}", values)
