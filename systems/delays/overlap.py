"""Cuts channels to the section of a frame that they share."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from systems.framework.compiling import njit

#: Length of the raised-cosine edges of the cut channels, samples. Sharp edges pull a
#: peak to whole samples by the inverse of length and squared bandwidth. For a 25 ms
#: frame at 50 kHz, this is 2e-3 samples, as much as noise at 30 dB. Soft edges reduce
#: it to a twentieth, and to zero if they follow the delays below one sample.
EDGE_SAMPLES = 16


def cut_to_overlap(
    frame: NDArray[np.float32], arrivals: NDArray[np.float64]
) -> NDArray[np.float32]:
    """Cuts the section that all channels share, with soft edges.

    Args:
        frame: (n, samples) channels.
        arrivals: (n,) arrivals relative to channel 0, samples. Channels are cut at
            whole samples, and their edges follow the rest of the delay.

    Returns:
        (n, m) in the unit of the frame; m is the length of the frame less the largest
        difference of the arrivals, in whole samples.
    """
    cut, length = cut_rows(frame, arrivals, *frame.shape)
    return np.ascontiguousarray(cut[:, :length])


@njit(cache=True)
def cut_rows(
    frame: NDArray[np.float32], arrivals: NDArray[np.float64], rows: int, columns: int
) -> tuple[NDArray[np.float32], int]:  # pragma: no cover  (compiled)
    """Cuts as ``cut_to_overlap``, with zeros after the section and in further rows.

    Args:
        frame: (n, samples) channels.
        arrivals: (n,) arrivals relative to channel 0, samples.
        rows: Rows of the output, at least n.
        columns: Columns of the output, at least m.

    Returns:
        (rows, columns), of which the first m columns contain the section, and m.
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
    """Returns the sample k of a raised cosine; k need not be whole."""
    share = min(max((k + 0.5) / EDGE_SAMPLES, 0.0), 1.0)
    return np.float32(0.5 - 0.5 * math.cos(math.pi * share))
