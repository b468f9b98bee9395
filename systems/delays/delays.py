"""Measures the delays between the channels of a frame of audio.

The measurement has four steps:

1. A search on a grid of lags finds the delays between close microphones.
2. The channels are cut to the section of the sound that they share. Without this step,
   the edges of the frame would shift the result.
3. Newton's method on the cross-spectrum finds the peak of the correlation of each pair
   of channels.
4. The coherence of the cut channels gives the errors of the delays.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from systems.delays.delay_peaks import Peaks, find_peaks
from systems.delays.delay_plan import DelayPlan
from systems.delays.delay_search import DelaySearch, search_delays
from systems.delays.occupied_band import occupied_band
from systems.delays.transforms import transform_rows

# Change of an arrival from which on the channels are cut again, samples.
_SETTLED = 0.75
# Largest number of cuts.
_CUTS = 4


class _Method(NamedTuple):
    phat: bool = False
    """Whether the cross-spectra are whitened."""
    by_amdf: bool = False
    """Whether ``amdf`` gives the delays, in whole samples."""


#: Methods to measure delays, by name.
METHODS = {
    "gcc": _Method(),
    "gcc_phat": _Method(phat=True),
    "amdf": _Method(by_amdf=True),
    "ml": _Method(),  # starts from gcc; see systems.hearing.coherent
}


class DelayEstimate(NamedTuple):
    """Delays of one frame, and measures of their reliability."""

    tau: NDArray[np.float64]
    """(n - 1,) delays t_k - t_0 of the channels k = 1 ... n - 1, s. t_k is the time of
    arrival at channel k."""
    covariance: NDArray[np.float64]
    """(n - 1, n - 1) covariance of the delays, s^2."""
    correlation: float
    """Least correlation coefficient of the pairs, 0 to 1."""
    closure: float
    """Largest disagreement between the delay of a pair and ``tau``, s."""
    ambiguity: float
    """Ratio of the second peak to the highest peak among the allowed lags, 0 to 1. It
    is the largest ratio over all edges (pairs of channels) of the plan."""
    chance: float
    """Probability that noise alone has peaks as high as those of all edges (pairs of
    channels)."""
    angular_frequency: float
    """Root mean square angular frequency of the sound that the channels share,
    rad/s."""
    noise_energy: float
    """Energy in a channel that the other channels do not share, units of the frame
    squared. It is the energy within the band, averaged over the channels."""
    band: slice
    """Bins of the plan's transform that were used."""


def look(
    frame: NDArray[np.float32],
    plan: DelayPlan,
    method: str = "gcc",
    *,
    find_band: bool = False,
) -> tuple[DelaySearch, slice] | None:
    """Searches a frame of audio for a sound.

    Args:
        frame: (n, frame_samples) channels, any unit.
        plan: Rates, band and array.
        method: A key of ``METHODS``.
        find_band: Whether to use only the part of the band that the sound occupies.

    Returns:
        Result of the search, and the bins that the search used. None if a channel is
        silent.
    """
    chosen = METHODS[method]
    spectra = transform_rows(frame, plan.length)[:, plan.band]
    band = plan.band
    if find_band:
        first, last = occupied_band(spectra, plan.sample_rate_hz / plan.length)
        spectra = spectra[:, first:last]
        band = slice(plan.band.start + first, plan.band.start + last)
    search = search_delays(
        frame, spectra, plan, band, phat=chosen.phat, by_amdf=chosen.by_amdf
    )
    return None if search is None else (search, band)


def estimate_delays(
    frame: NDArray[np.float32],
    plan: DelayPlan,
    method: str = "gcc",
    *,
    find_band: bool = False,
    seen: tuple[DelaySearch, slice] | None = None,
) -> DelayEstimate | None:
    """Measures the delays between the channels of an audio frame.

    Args:
        frame: (n, frame_samples) channels, any unit.
        plan: Rates, band and array.
        method: A key of ``METHODS``.
        find_band: Whether to use only the part of the band that the sound occupies.
        seen: Result of ``look`` for this frame, if it is known.

    Returns:
        The estimate, even if it is not reliable. None if a channel is silent, or if the
        correlation of a pair has no peak among the allowed lags.
    """
    seen = seen or look(frame, plan, method, find_band=find_band)
    return None if seen is None else settled_delays(frame, plan, method, seen)


def settled_delays(
    frame: NDArray[np.float32],
    plan: DelayPlan,
    method: str,
    seen: tuple[DelaySearch, slice],
) -> DelayEstimate | None:
    """Measures the delays of an audio frame near the delays that a search has found.

    Args:
        frame: (n, frame_samples) channels, any unit.
        plan: Rates, band and array.
        method: A key of ``METHODS``.
        seen: Result of ``look``. To start elsewhere, pass a copy with other arrivals.

    Returns:
        The estimate or None, as for ``estimate_delays``.
    """
    chosen = METHODS[method]
    search, band = seen
    arrivals = search.arrivals
    for _ in range(_CUTS):
        reach = arrivals.tolist()
        if max(reach) - min(reach) > plan.max_lag + 1:
            return None
        peaks = find_peaks(
            frame,
            arrivals,
            plan.tables,
            length=plan.length,
            band=band,
            phat=chosen.phat,
            newton=not chosen.by_amdf,
        )
        if peaks is None:
            return None
        arrivals = peaks.arrivals
        if peaks.moved < _SETTLED:
            return _estimate(peaks, search, band, plan)
    return None


def _estimate(
    peaks: Peaks, search: DelaySearch, band: slice, plan: DelayPlan
) -> DelayEstimate:
    rate = plan.sample_rate_hz
    return DelayEstimate(
        tau=peaks.arrivals[1:] / rate,
        covariance=peaks.covariance / rate**2,
        correlation=peaks.correlation,
        closure=peaks.closure / rate,
        ambiguity=search.ambiguity,
        chance=search.chance,
        angular_frequency=peaks.angular_frequency * rate,
        noise_energy=peaks.noise_energy,
        band=band,
    )
