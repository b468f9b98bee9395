"""Computes the energy of a frame of audio without rumble (low frequencies)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from systems.framework.compiling import njit

#: Length of the blocks from which the mean is subtracted, samples. At 100 kHz, the
#: subtraction reduces rumble of 100 Hz by 19 dB, so that rumble of a motor does not
#: hide a sound.
BLOCK_SAMPLES = 64


@njit(cache=True)
def frame_energy(frame: NDArray[Any]) -> float:  # pragma: no cover  (compiled)
    """Computes the sum of squares of a frame (n, samples) without its block means."""
    channels, samples = frame.shape
    whole = samples - samples % BLOCK_SAMPLES
    energy = 0.0
    for m in range(channels):
        for begin in range(0, whole, BLOCK_SAMPLES):
            energy += _block_energy(frame[m], begin, BLOCK_SAMPLES)
        if whole < samples:
            energy += _block_energy(frame[m], whole, samples - whole)
    return energy


@njit(cache=True, error_model="numpy")
def _block_energy(
    samples: NDArray[Any], begin: int, count: int
) -> Any:  # pragma: no cover  (compiled)
    """Computes the sum of squares of a block of numbers, after subtracting its mean."""
    total, squares = np.float32(0.0), np.float32(0.0)
    for k in range(count):
        x = np.float32(samples[begin + k])
        total += x
        squares += x * x
    return squares - total * total / np.float32(count)
