"""Measures a set of delays for each of several overlapping sounds.

Independent sounds add up in the correlations. Each sound has a peak in the correlation
of every pair of channels. The height of the peak is the sound's share of the power. The
lags of one sound add up to zero around every triangle of channels.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from systems.delays.consistent_lags import consistent_lags
from systems.delays.delay_peaks import whitening
from systems.delays.delay_plan import DelayPlan
from systems.delays.delay_search import DelaySearch
from systems.delays.delays import DelayEstimate, settled_delays
from systems.delays.transforms import transform_rows

# Largest distance between the peak of a pair and the lag that closes the triangle,
# columns.
_OFF = 2


def estimate_delay_sets(
    frame: NDArray[np.float32],
    plan: DelayPlan,
    method: str,
    seen: tuple[DelaySearch, slice],
    count: int,
) -> list[DelayEstimate]:
    """Measures the delays of the sounds of a frame.

    The set with the greatest sum of correlations is found and refined. Its peaks are
    then removed, and the search is repeated.

    Args:
        frame: (n, frame_samples) channels, any unit.
        plan: Rates, band and array.
        method: A key of ``METHODS``.
        seen: Result of ``look`` for this frame.
        count: Number of sets to search for.

    Returns:
        At most ``count`` estimates, the one with the greatest sum of correlations
        first. The other sounds count as noise in the errors of each estimate.
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
    """Computes the whitened correlations of all pairs on the grid of the plan.

    Returns:
        (p, 2 m + 1) correlations, and m, which is the column of lag 0.
    """
    spectra = transform_rows(frame, plan.length)[:, band]
    i, j = plan.shape.pairs.T
    cross = np.zeros((len(i), plan.grid // 2 + 1), dtype=np.complex64)
    cross[:, band] = spectra[i].conj() * spectra[j]
    cross[:, band] *= whitening(cross[:, band])
    correlation = fft.irfft(cross, plan.grid)
    lags = plan.shape.max_delay(plan.c) * plan.sample_rate_hz * plan.grid / plan.length
    middle = math.ceil(lags) + 1
    return (
        np.concatenate(
            (correlation[:, -middle:], correlation[:, : middle + 1]), axis=1
        ),
        middle,
    )
