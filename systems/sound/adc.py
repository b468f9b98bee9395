"""Conversion of sound pressure to counts: microphone, amplifier and converter."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from systems.framework.compiling import njit
from systems.framework.finite import check_finite
from systems.sound.parameters import FULL_SCALE_PA, MicArrayParameters


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
    full_scale_pa: float = FULL_SCALE_PA,
) -> NDArray[np.int16]:
    """Converts sound pressure to counts of the A/D converter, rounded and clipped.

    Args:
        pressure: (m, n) sound pressure of m channels, Pa; None for silence.
        noise: (m, n) noise of unit variance.
        noise_pa: RMS of the noise, Pa. The function multiplies ``noise`` by it.
        parameters: Resolution.
        gains: (m,) true gain divided by stated gain of each channel. None: all are 1.
        full_scale_pa: Sound pressure at full scale, Pa.

    Returns:
        (m, n) counts in [-2^(bits - 1), 2^(bits - 1) - 1].

    Raises:
        ValueError: A pressure, a noise value, or a gain is not finite. Without this
            check, the counts would hide the error.
    """
    if gains is None:
        gains = np.ones(len(noise))
    if pressure is None:
        pressure = np.zeros_like(noise)
    gain = parameters.full_scale / full_scale_pa
    full_scale = np.float32(parameters.full_scale)
    out = np.empty(noise.shape, dtype=np.int16)
    if _counts(pressure, noise, gains, gain, gain * noise_pa, full_scale, out):
        check_finite("MicArray: pressure", pressure)
        check_finite("MicArray: noise", noise)
        check_finite("MicArray: gains", gains)
    return out
