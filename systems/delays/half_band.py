"""Frames at half their rate: what lies above would be transformed for nothing.

A half-band filter of 19 taps, every other one zero: flat to 0.02 dB up to
``PASSED`` times the rate, and 55 dB down from where the rest would fold onto that.
It is symmetrical and the same for all channels, so that delays stay what they are.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from systems.framework.compiling import njit

#: Highest frequency that passes, as a share of the rate.
PASSED = 0.15

# Taps beside the middle one, on each side; the rest are zero.
_PAIRS = 5
# Of the Kaiser window: more would leak less and pass less.
_BETA = 5.0


def _taps() -> tuple[np.float32, ...]:
    """The taps at 1, 3, 5 ... samples from the middle one, which is 1/2."""
    away = 2.0 * np.arange(_PAIRS) + 1.0
    window = np.i0(_BETA * np.sqrt(1.0 - (away / (2.0 * _PAIRS)) ** 2))
    taps = np.sinc(away / 2.0) * window
    return tuple((taps / (4.0 * taps.sum())).astype(np.float32))


_TAPS = _taps()


@njit(cache=True)
def halve_rate(
    frame: NDArray[Any],
) -> NDArray[np.float32]:  # pragma: no cover  (compiled)
    """Every other sample of what passes.

    Args:
        frame: (n, samples) channels, floats or counts.

    Returns:
        (n, samples // 2) float32, at the second, fourth ... sample. Beyond the
        frame there is silence: four or five at each end miss a part.
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
    """Fills in one channel; odd (half,) is scratch, and even between its ends."""
    inside = even[_PAIRS - 1 : _PAIRS - 1 + odd.size]
    for k in range(odd.size):
        inside[k], odd[k] = samples[2 * k], samples[2 * k + 1]
    a, b, c, d, e = _TAPS
    for k in range(odd.size):
        near = a * (even[k + 4] + even[k + 5]) + b * (even[k + 3] + even[k + 6])
        far = c * (even[k + 2] + even[k + 7]) + d * (even[k + 1] + even[k + 8])
        last = e * (even[k] + even[k + 9])
        out[k] = np.float32(0.5) * odd[k] + (near + far + last)
