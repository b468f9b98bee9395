"""Halves the sample rate of frames of audio, so that their transforms are faster.

The half-band filter has 19 taps. Every other tap is zero, except the middle tap. Up to
``PASSED`` times the sample rate, the filter is flat to 0.02 dB. It suppresses by 55 dB
the frequencies that alias to this range. The filter is symmetrical and the same for all
channels, so that it does not change the delays between channels.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from systems.framework.compiling import njit

#: Highest frequency that passes, as a share of the sample rate.
PASSED = 0.15

# Number of nonzero taps on each side of the middle one.
_PAIRS = 5
# Parameter of the Kaiser window. A larger value reduces leakage and narrows the band.
_BETA = 5.0


def _taps() -> tuple[np.float32, ...]:
    """Returns the taps 1, 3, 5 ... samples away from the middle tap, which is 1/2."""
    away = 2.0 * np.arange(_PAIRS) + 1.0
    window = np.i0(_BETA * np.sqrt(1.0 - (away / (2.0 * _PAIRS)) ** 2))
    taps = np.sinc(away / 2.0) * window
    return tuple((taps / (4.0 * taps.sum())).astype(np.float32))


_TAPS = _taps()


@njit(cache=True)
def halve_rate(
    frame: NDArray[Any],
) -> NDArray[np.float32]:  # pragma: no cover  (compiled)
    """Filters an audio frame and keeps every other sample.

    Args:
        frame: (n, samples) channels, floats or counts.

    Returns:
        (n, samples // 2) float32 filtered values at the second, fourth ... sample. The
        first and last four or five values are inexact, because the filter assumes
        silence before and after the frame.
    """
    channels, samples = frame.shape
    half = samples // 2
    out = np.empty((channels, half), dtype=np.float32)
    even = np.zeros(half + 2 * _PAIRS - 1, dtype=np.float32)
    odd = np.empty(half, dtype=np.float32)
    for m in range(channels):
        _halve_row(frame[m], even, odd, out[m])
    return out


@njit(cache=True)
def _halve_row(
    samples: NDArray[Any],
    even: NDArray[np.float32],
    odd: NDArray[np.float32],
    out: NDArray[np.float32],
) -> None:  # pragma: no cover  (compiled)
    """Filters one channel and keeps every other sample.

    The arrays ``odd`` and ``even`` are scratch memory. The ends of ``even`` must be
    zero.
    """
    inside = even[_PAIRS - 1 : _PAIRS - 1 + odd.size]
    for k in range(odd.size):
        inside[k], odd[k] = samples[2 * k], samples[2 * k + 1]
    a, b, c, d, e = _TAPS
    for k in range(odd.size):
        near = a * (even[k + 4] + even[k + 5]) + b * (even[k + 3] + even[k + 6])
        far = c * (even[k + 2] + even[k + 7]) + d * (even[k + 1] + even[k + 8])
        last = e * (even[k] + even[k + 9])
        out[k] = np.float32(0.5) * odd[k] + (near + far + last)
