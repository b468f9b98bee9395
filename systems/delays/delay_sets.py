"""Measures a set of delays for each of several overlapping sounds.

The correlation of a pair of channels is the sum of the correlations of the independent
sounds. Each sound has a peak in the correlation of every pair. The height of the peak
is the sound's share of the power.

In a room, each channel contains the direct sound and its echoes. Each of these arrivals
in one channel correlates with each arrival in the other channel. The correlation of a
pair therefore has many peaks, and the peak of an echo may be the highest. Only the lags
of one sound are consistent: the lag from channel i to k is the sum of the lags from i
to j and from j to k. The module therefore searches for consistent sets of lags.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from systems.delays.correlations import correlations_at_lags, whitening
from systems.delays.delay_plan import DelayPlan
from systems.delays.delay_search import DelaySearch
from systems.delays.delays import DelayEstimate, settled_delays
from systems.delays.transforms import transform_rows

# Largest number of peaks per pair, then largest number of sets of lags, that the search
# keeps.
_PEAKS, _SETS = 12, 48

# Two sets are different if one of their lags differs by more than _APART columns. Lags
# are consistent if their sums differ by at most _OFF columns.
_APART, _OFF = 8, 2


def estimate_delay_sets(
    frame: NDArray[np.float32],
    plan: DelayPlan,
    method: str,
    seen: tuple[DelaySearch, slice],
    count: int,
) -> list[DelayEstimate]:
    """Measures the delays of the sounds of an audio frame, one set of delays per sound.

    The function finds and refines the set with the largest sum of correlations. It then
    removes the peaks of this set and repeats the search.

    Args:
        frame: (n, frame_samples) channels, any unit.
        plan: Rates, band and array.
        method: A key of ``METHODS``.
        seen: Result of ``look`` for this frame.
        count: Number of sets to search for.

    Returns:
        At most ``count`` estimates. The estimate with the largest sum of correlations
        is first. In the errors of each estimate, the other sounds count as noise.
    """
    search, band = seen
    correlations, middle = _correlations(frame, plan, band)
    to_columns = plan.grid / plan.length
    reach = plan.shape.distances_m / plan.c * plan.sample_rate_hz * to_columns
    whole = np.minimum(np.ceil(reach).astype(np.int64) + 1, middle)
    found = []
    for _ in range(count):
        sets = consistent_lags(correlations, plan.shape.pairs, whole, 1)
        if not sets:
            break
        (lags,) = sets
        start = search._replace(arrivals=lags / to_columns, ambiguity=0.0)
        delays = settled_delays(frame, plan, method, (start, band))
        if delays is not None:
            found.append(delays)
        for row, (i, j) in zip(correlations, plan.shape.pairs.tolist(), strict=True):
            _remove_peak(row, middle + int(lags[j] - lags[i]))
    return found


def _remove_peak(correlation: NDArray[np.float32], column: int) -> None:
    """Removes the peak near a column, down to the valleys on both sides."""
    first, last = max(column - _OFF, 0), correlation.size - 1
    low = high = first + int(correlation[first : column + _OFF + 1].argmax())
    while low > 0 and correlation[low - 1] <= correlation[low]:
        low -= 1
    while high < last and correlation[high + 1] <= correlation[high]:
        high += 1
    correlation[low : high + 1] = -np.inf


def _correlations(
    frame: NDArray[np.float32], plan: DelayPlan, band: slice
) -> tuple[NDArray[np.float32], int]:
    """Returns the whitened correlations of all pairs, and the column m of lag 0.

    The correlations (p, 2 m + 1) are on the grid of the plan.
    """
    spectra = transform_rows(frame, plan.length)[:, band]
    i, j = plan.shape.pairs.T
    cross = spectra[i].conj() * spectra[j]
    cross *= whitening(cross)
    lags = plan.shape.max_delay(plan.c) * plan.sample_rate_hz * plan.grid / plan.length
    middle = math.ceil(lags) + 1
    return correlations_at_lags(cross, band, plan.grid, middle), middle


def consistent_lags(
    correlations: NDArray[np.float32],
    pairs: NDArray[np.int64],
    reach: NDArray[np.int64],
    count: int,
) -> list[NDArray[np.int64]]:
    """Finds the sets of lags with the largest sum of correlations over all pairs.

    A set has one lag per channel. The function adds the channels one after another. It
    combines each set so far with each peak of the next channel, and keeps the best
    combinations. The unit of a lag is one column of the correlations.

    Args:
        correlations: (p, 2 m + 1) correlation of each pair. Lag 0 is in the middle.
        pairs: (p, 2) pairs i < j of the n channels.
        reach: (p,) longest lag of each pair in either direction, at most m columns.
        count: Largest number of sets.

    Returns:
        Sets of (n,) lags relative to channel 0, columns. The set with the largest sum
        is first. The list is empty if no set is consistent.
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
