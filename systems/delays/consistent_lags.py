"""Delays of all channels that belong together, of the many peaks of each pair.

In a room the correlation of two channels has a peak for every pair of paths, and an
echo's may be the highest. Those of the direct sound add up: the lag from channel i
to k is that from i to j and from j to k.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

# Peaks of a pair, and sets of lags, that are followed up.
_PEAKS, _SETS = 12, 48

# Sets differ by more than this in some lag, and lags may be off by this, columns.
_APART, _OFF = 8, 2


def consistent_lags(
    correlations: NDArray[np.float32],
    pairs: NDArray[np.int64],
    reach: NDArray[np.int64],
    count: int,
) -> list[NDArray[np.int64]]:
    """Sets of lags with the greatest sums of all pairs' correlations.

    Channels join one after another, and the best sets are kept.

    Args:
        correlations: (p, 2 m + 1) of each pair; no lag stands in the middle.
        pairs: (p, 2) channels i < j of n.
        reach: (p,) longest lag of each pair either way, columns, at most m.
        count: Number of sets.

    Returns:
        Sets (n,) of lags after channel 0, columns; the best one first.
    """
    wide = maximum_filter1d(correlations, 2 * _OFF + 1, axis=1)
    middle = correlations.shape[1] // 2
    row = {(int(i), int(j)): p for p, (i, j) in enumerate(pairs)}
    channels = int(pairs.max()) + 1
    sets, scores = np.zeros((1, 1), dtype=np.int64), np.zeros(1)
    for k in range(1, channels):
        p = row[0, k]
        lags = _peaks(correlations[p], int(reach[p]))
        if not lags.size:
            return []
        score = scores[:, np.newaxis] + correlations[p, middle + lags]
        for j in range(1, k):
            between = lags - sets[:, j, np.newaxis]
            p = row[j, k]
            value = wide[p, middle + np.clip(between, -reach[p], reach[p])]
            score += np.where(np.abs(between) <= reach[p], value, -np.inf)
        order = np.argsort(-score, axis=None)[:_SETS]
        order = order[np.isfinite(score.flat[order])]
        rows, columns = np.unravel_index(order, score.shape)
        sets = np.column_stack((sets[rows], lags[columns]))
        scores = score.flat[order]
    found: list[NDArray[np.int64]] = []
    for lags in sets:
        if len(found) < count and all(np.abs(lags - f).max() > _APART for f in found):
            found.append(lags)
    return found


def _peaks(correlation: NDArray[np.float32], reach: int) -> NDArray[np.int64]:
    """Lags of the highest peaks within reach, its ends included."""
    from scipy.signal import find_peaks

    middle = correlation.size // 2
    inside = correlation[middle - reach : middle + reach + 1]
    peaks = find_peaks(np.pad(inside, 1, constant_values=-np.inf))[0] - 1
    return peaks[np.argsort(-inside[peaks])[:_PEAKS]] - reach
