"""Finds sets of lags that belong together among the many peaks of each pair.

In a room, each channel contains the direct sound and its echoes. The correlation of two
channels has a peak for every pair of these arrivals. The peak of an echo may be the
highest. The lags of the direct sound are consistent: the lag from channel i to k is the
sum of the lags from i to j and from j to k.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

# Largest number of peaks per pair, and of sets of lags, that the search keeps.
_PEAKS, _SETS = 12, 48

# Two sets are different if one of their lags differs by more than _APART columns. Lags
# are consistent if their sums differ by at most _OFF columns.
_APART, _OFF = 8, 2


def consistent_lags(
    correlations: NDArray[np.float32],
    pairs: NDArray[np.int64],
    reach: NDArray[np.int64],
    count: int,
) -> list[NDArray[np.int64]]:
    """Finds the sets of lags with the greatest sum of correlations over all pairs.

    The channels are added one after another. Each set is combined with each peak of the
    next channel, and the best combinations are kept.

    Args:
        correlations: (p, 2 m + 1) correlation of each pair; lag 0 is in the middle.
        pairs: (p, 2) channels i < j of n.
        reach: (p,) longest lag of each pair in either direction, columns, at most m.
        count: Largest number of sets.

    Returns:
        Sets of (n,) lags relative to channel 0, columns. The set with the greatest sum
        is first.
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
        # (sets, lags) scores of all combinations.
        score = scores[:, np.newaxis] + correlations[p, middle + lags]
        for j in range(1, k):
            between = lags - sets[:, j, np.newaxis]
            p = row[j, k]
            value = wide[p, middle + np.clip(between, -reach[p], reach[p])]
            score += np.where(np.abs(between) <= reach[p], value, -np.inf)
        # The best combinations with lags within reach.
        order = np.argsort(-score, axis=None)[:_SETS]
        order = order[np.isfinite(score.flat[order])]
        rows, columns = np.unravel_index(order, score.shape)
        sets = np.column_stack((sets[rows], lags[columns]))
        scores = score.flat[order]
    # The best sets that differ from all better ones.
    found: list[NDArray[np.int64]] = []
    for lags in sets:
        if len(found) < count and all(np.abs(lags - f).max() > _APART for f in found):
            found.append(lags)
    return found


def _peaks(correlation: NDArray[np.float32], reach: int) -> NDArray[np.int64]:
    """Returns the lags of the highest peaks from -reach to reach, ends included."""
    from scipy.signal import find_peaks

    middle = correlation.size // 2
    inside = correlation[middle - reach : middle + reach + 1]
    peaks = find_peaks(np.pad(inside, 1, constant_values=-np.inf))[0] - 1
    return peaks[np.argsort(-inside[peaks])[:_PEAKS]] - reach
