"""The stretch of a frame that all channels share."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from systems.framework.compiling import njit

#: Raised-cosine edges of the cut channels, samples. Sharp edges pull a peak to
#: whole samples by one over the length and the squared bandwidth: 2e-3 samples of
#: a 25 ms frame at 50 kHz, as much as the noise at 30 dB. These leave a twentieth
#: of it, and nothing where they follow the delays below the sample.
EDGE_SAMPLES = 16


def cut_to_overlap(
    frame: NDArray[np.float32], arrivals: NDArray[np.float64]
) -> NDArray[np.float32]:
    """The stretch that all channels share, with soft edges.

    Args:
        frame: (n, samples) channels.
        arrivals: (n,) arrival at each channel after channel 0, samples. Channels
            are cut at whole samples; their edges follow what is left of it.

    Returns:
        (n, m) in the frame's unit; m is the frame's length less the largest difference
        of the arrivals, in whole samples.
    """
    cut, length = cut_rows(frame, arrivals, *frame.shape)
    return np.ascontiguousarray(cut[:, :length])


@njit(cache=True)
def cut_rows(
    frame: NDArray[np.float32], arrivals: NDArray[np.float64], rows: int, columns: int
) -> tuple[NDArray[np.float32], int]:  # pragma: no cover  (compiled)
    """``cut_to_overlap``, with zeros after and below.

    Args:
        frame: (n, samples) channels.
        arrivals: (n,) arrival at each channel after channel 0, samples.
        rows: Of the output, at least n.
        columns: Of the output, at least m.

    Returns:
        (rows, columns), of which the first m columns hold the stretch, and m.
    """
    channels, samples = frame.shape
    whole = np.rint(arrivals)
    earliest = whole.min()
    length = samples - int(whole.max() - earliest)
    cut = np.zeros((rows, columns), dtype=frame.dtype)
    edge = EDGE_SAMPLES if length >= 2 * EDGE_SAMPLES else 0
    for m in range(channels):
        start, late = int(whole[m] - earliest), arrivals[m] - whole[m]
        for k in range(length):
            cut[m, k] = frame[m, start + k]
        for k in range(edge):
            cut[m, k] *= _ramp(k - late)
            cut[m, length - 1 - k] *= _ramp(k + late)
    return cut, length


@njit(cache=True)
def _ramp(k: float) -> np.float32:  # pragma: no cover  (compiled)
    """A raised cosine's sample of number k, which need not be whole."""
    share = min(max((k + 0.5) / EDGE_SAMPLES, 0.0), 1.0)
    return np.float32(0.5 - 0.5 * math.cos(math.pi * share))
