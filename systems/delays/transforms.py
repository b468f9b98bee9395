"""Computes Fourier transforms of the channels of an audio frame, in compiled code.

The results are equal to those of SciPy to the last bit. For transforms as short as
these, SciPy spends half of the time on finding the right function.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from rocket_fft import r2c

from systems.framework.compiling import njit


@njit(cache=True)
def filled_rows(channels: int) -> int:  # pragma: no cover  (compiled)
    """Returns the number of rows to transform for a number of channels.

    The library rocket_fft transforms rows of single precision four at a time. If three
    rows remain, it transforms them one by one. A fourth row of zeros then saves a third
    of the time, so the result is the number of channels plus 1. In all other cases, the
    result is the number of channels.
    """
    return channels + (1 if channels % 4 == 3 else 0)


@njit(cache=True)
def transform_filled_rows(
    rows: NDArray[Any],
) -> NDArray[Any]:  # pragma: no cover  (compiled)
    """Computes the (n, length // 2 + 1) Fourier spectra of (n, length) rows.

    The spectra have the precision of the rows, single or double.
    """
    precision = rows[:1, :1] * np.complex64(1.0)
    shape = rows.shape[0], rows.shape[1] // 2 + 1
    out = np.empty(shape, dtype=precision.dtype)
    forward = True
    r2c(rows, out, np.array([1]), forward, 1.0, 1)
    return out


@njit(cache=True)
def transform_rows(
    frame: NDArray[np.float32], length: int
) -> NDArray[np.complex64]:  # pragma: no cover  (compiled)
    """Computes the Fourier spectra of channels that are padded with zeros.

    Args:
        frame: (n, samples) channels, any unit.
        length: Length of the transform, samples; at least that of the channels.

    Returns:
        (n, length // 2 + 1) spectra in the unit of the audio frame.
    """
    channels, samples = frame.shape
    rows = np.zeros((filled_rows(channels), length), dtype=np.float32)
    for m in range(channels):
        for k in range(samples):
            rows[m, k] = frame[m, k]
    return transform_filled_rows(rows)[:channels]
