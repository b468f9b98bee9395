"""How loud a frame is."""

from __future__ import annotations

from numba import njit

from systems.propagation import REORDER

__all__ = ["BLOCK_SAMPLES", "frame_energy"]

#: The mean of so many samples does not count: rumble of 100 Hz loses 19 dB of it at
#: 100 kHz, so that a motor's does not hide a sound.
BLOCK_SAMPLES = 64


@njit(cache=True, fastmath=REORDER)
def frame_energy(frame):  # pragma: no cover  (compiled)
    """Sum of squares of an (n, samples) frame about the means of short blocks."""
    energy = 0.0
    for m in range(frame.shape[0]):
        for begin in range(0, frame.shape[1], BLOCK_SAMPLES):
            block = frame[m, begin : begin + BLOCK_SAMPLES]
            total = frame.dtype.type(0)
            squares = frame.dtype.type(0)
            for x in block:
                total += x
                squares += x * x
            energy += squares - total * total / block.size
    return energy
