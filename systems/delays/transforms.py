"""Fourier transforms of the channels of a frame."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import fft

__all__ = ["filled_rows", "transform_rows"]


def filled_rows(channels: int) -> int:
    """Rows to transform for so many channels.

    Single precision is transformed four rows at a time, and a rest of three one
    by one: with a fourth row of zeros it takes two thirds of the time.
    """
    return channels + (channels % 4 == 3)


def transform_rows(frame: NDArray[np.float32], length: int) -> NDArray[np.complex64]:
    """Spectra of channels that are padded with zeros.

    Args:
        frame: (n, samples) channels, any unit.
        length: Of the transform, samples; at least that of the channels.

    Returns:
        (n, length // 2 + 1), in the unit of the frame.
    """
    channels, samples = frame.shape
    rows = np.zeros((filled_rows(channels), length), dtype=np.float32)
    rows[:channels, :samples] = frame
    return fft.rfft(rows)[:channels]
