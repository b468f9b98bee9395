"""Several sets of delays in one frame: one for each of the sounds that overlap.

Sounds that do not depend on each other add up in the correlations: each has its peaks,
as high as its share of the power, in all pairs of channels, and the lags of one sound
close around every triangle of channels.
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

# A pair's peak may be off the lag that closes the triangle by so much, columns.
_OFF = 2


def estimate_delay_sets(
    frame: NDArray[np.float32],
    plan: DelayPlan,
    method: str,
    seen: tuple[DelaySearch, slice],
    count: int,
) -> list[DelayEstimate]:
    """Delays of the sounds of a frame.

    Args:
        frame: (n, frame_samples), any unit.
        plan: Rates, band and array.
        method: A key of ``METHODS``.
        seen: What ``look`` returned for this frame.
        count: Of sets that are followed up.

    Returns:
        At most ``count`` estimates, that of the greatest sum of correlations first.
        What other sounds hold counts as noise in the errors of each.
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
    """Takes the peak near a column out, down to the valleys beside it."""
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
    """(p, 2 m + 1) whitened correlations of all pairs on the plan's grid, and m."""
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
