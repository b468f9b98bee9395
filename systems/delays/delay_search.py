"""Detects a sound in a frame of audio, and makes initial estimates of its delays.

The noises of different channels are independent, whatever their spectra. The
correlation of two noise channels at a lag therefore has a Gaussian distribution, whose
variance follows from the spectra. From this distribution and the height of the highest
peak, the module computes the probability that noise alone reaches this height.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rocket_fft import c2r

from systems.delays.correlations import whitening
from systems.delays.delay_plan import DelayPlan
from systems.framework.compiling import njit

# Largest coherence that is assumed, because there is always some noise.
_WHOLE = 0.99

# Height that noise is assumed never to reach, standard deviations of the noise.
_HIGHEST = 38.0


class DelaySearch(NamedTuple):
    """Result of the first search in a frame."""

    arrivals: NDArray[np.float64]
    """(n,) times of arrival relative to channel 0, samples."""
    ambiguity: float
    """Ratio of the second peak to the highest peak among the allowed lags, 0 to 1. It
    is the largest ratio over all edges (pairs of channels) of the plan."""
    chance: float
    """Probability that noise alone has peaks as high as those of all edges (pairs of
    channels)."""
    weakest: float
    """Probability that noise alone has a peak as high as the lowest peak of all edges
    (pairs of channels). If the sound has not reached all channels yet, it is near 1."""
    energy: float
    """Energy of a channel within the band, averaged over the channels, units of the
    frame squared."""


@njit(cache=True)
def amdf(
    x_i: NDArray[np.float32], x_j: NDArray[np.float32], max_lag: int
) -> NDArray[np.float64]:  # pragma: no cover  (compiled)
    """Computes the average magnitude difference of two channels (Han 2019, eq. 4-6).

    The papers maximize 1 / sum_k |x_i(k) - x_j(k + lag)| over the lags 0 to n - 1. This
    function differs from the papers in three ways:

    - It returns the sum itself, so that equal signals cause no division by zero.
    - It includes negative lags.
    - It divides the sum by the number of its terms, because the sum alone favors large
      lags.

    Args:
        x_i: (n,) samples of channel i.
        x_j: (n,) samples of channel j.
        max_lag: Largest lag, below n.

    Returns:
        (2 max_lag + 1,) differences for the lags -max_lag to max_lag. The minimum is at
        the delay t_j - t_i, where t_i is the time of arrival at channel i.
    """
    n = x_i.size
    out = np.empty(2 * max_lag + 1)
    for lag in range(-max_lag, max_lag + 1):
        first, last = max(0, -lag), min(n, n - lag)
        total = np.float32(0.0)
        for k in range(first, last):
            total += abs(x_i[k] - x_j[k + lag])
        out[lag + max_lag] = total / (last - first)
    return out


@njit(cache=True)
def _peak(
    values: NDArray[Any],
) -> tuple[np.intp, float]:  # pragma: no cover  (compiled)
    """Finds the highest value, and the ratio of the second peak to the highest peak.

    The main lobe around the highest value ends where the values are at most half of it.
    If the highest value is at a border, it is no peak, and the ratio is 1.
    """
    best = np.argmax(values)
    top = values[best]
    if best in (0, values.size - 1) or top <= 0.0:
        return best, 1.0
    low, high = best, best
    while low > 0 and values[low] > 0.5 * top:
        low -= 1
    while high < values.size - 1 and values[high] > 0.5 * top:
        high += 1
    second = 0.0
    for k in range(values.size):
        if (k < low or k > high) and values[k] > second:
            second = values[k]
    return best, second / top


@njit(cache=True)
def _cross_spectra(
    spectra: NDArray[np.complex64], edges: NDArray[np.int64], first: int, size: int
) -> tuple[
    NDArray[np.complex64], NDArray[np.float64], float
]:  # pragma: no cover  (compiled)
    """Computes the cross-spectra of pairs of channels (edges).

    The spectra begin at the bin ``first``. All other bins of the cross-spectra are
    zero.

    Returns:
        Three values: (e, size) cross-spectra C; (e, 2) sums of |C|^2 and of k^2 |C|^2
        over the bins k; and mean energy of the channels, or 0 if a channel is silent.
    """
    channels, bins = spectra.shape
    cross = np.zeros((len(edges), size), dtype=spectra.dtype)
    moments, energy = np.zeros((len(edges), 2)), np.zeros(channels)
    for e in range(len(edges)):
        i, j = edges[e]
        for k in range(bins):
            c = spectra[i, k].conjugate() * spectra[j, k]
            cross[e, first + k] = c
            square = c.real * c.real + c.imag * c.imag
            moments[e, 0] += square
            moments[e, 1] += square * np.float32((first + k) ** 2)
    for m in range(channels):
        for k in range(bins):
            a = spectra[m, k]
            energy[m] += a.real * a.real + a.imag * a.imag
    return cross, moments, energy.mean() if energy.min() > 0.0 else 0.0


@njit(cache=True)
def _gated_peak(
    correlation: NDArray[np.float32], gate: int
) -> tuple[float, float, float]:  # pragma: no cover  (compiled)
    """Finds the highest peak of a correlation among the lags from -gate to gate.

    The function returns the lag of the peak, samples; the ratio of the second peak to
    the highest peak; and the height of the highest peak.
    """
    gated = np.empty(2 * gate + 1, dtype=correlation.dtype)
    for k in range(gate):
        gated[k] = correlation[correlation.size - gate + k]
    for k in range(gate + 1):
        gated[gate + k] = correlation[k]
    best, ratio = _peak(gated)
    lag = float(best - gate)
    if 0 < best < 2 * gate:  # vertex of a parabola
        rise, fall = gated[best] - gated[best - 1], gated[best] - gated[best + 1]
        lag += 0.5 * (rise - fall) / max(rise + fall, np.float32(1e-30))
    return lag, ratio, gated[best]


@njit(cache=True)
def _chance_of_noise(
    heights: NDArray[np.float64], counts: NDArray[np.float64]
) -> tuple[float, float]:  # pragma: no cover  (compiled)
    """Computes the probabilities that noise alone reaches peaks of given heights.

    Args:
        heights: (e,) heights of the peaks, in standard deviations of the noise.
        counts: (e,) expected number of upward zero crossings of noise among the allowed
            lags. The expected number of crossings of the height z is smaller by the
            factor exp(-z^2 / 2) (Rice 1944).

    Returns:
        Probability that noise reaches all peaks, and probability that it reaches the
        lowest peak.
    """
    log_product, weakest = 0.0, 0.0
    for e in range(heights.size):
        z = heights[e]
        crossings = counts[e] * math.exp(-0.5 * z * z) if z < _HIGHEST else 0.0
        below = (1.0 - 0.5 * math.erfc(z / math.sqrt(2.0))) * math.exp(-crossings)
        log_product += math.log(max(1.0 - below, 1e-300))
        weakest = max(weakest, 1.0 - below)
    # Probability that a product of as many independent uniform numbers is at most this
    # product (Fisher).
    term, total = 1.0, 0.0
    for k in range(heights.size):
        total += term
        term *= -log_product / (k + 1)
    return min(math.exp(log_product) * total, 1.0), weakest


@njit(cache=True)
def _judge(
    cross: NDArray[np.complex64],
    grid: int,
    moments: NDArray[np.float64],
    edges: NDArray[np.int64],
    gates: NDArray[np.int64],
    padding: float,
    stretch: float,
) -> tuple[NDArray[np.float64], float, float, float]:  # pragma: no cover  (compiled)
    """Computes the fields arrivals, ambiguity, chance and weakest of ``DelaySearch``.

    For each edge (pair of channels), the highest peak of the correlation gives the lag.
    The edges form a tree, and the sums of the lags along the tree give the arrivals.
    The heights of the peaks relative to the noise give ``chance`` and ``weakest``.

    Args:
        cross: (e, grid // 2 + 1) cross-spectra of the edges.
        grid: Number of samples of each correlation.
        moments: (e, 2) sums from ``_cross_spectra``.
        edges: (e, 2) channels of each edge.
        gates: (e,) largest lag of each edge, samples of the correlation.
        padding: Length of the transform divided by the length of the audio frame.
        stretch: Samples of the frame per sample of the correlation.

    Returns:
        The four fields, in the order above.
    """
    count = len(cross)
    correlation = np.empty((count, grid), dtype=np.float32)
    forward = False
    c2r(cross, correlation, np.array([1]), forward, 1.0, 1)
    arrivals, ambiguity = np.zeros(count + 1), 0.0
    heights, counts = np.empty(count), np.empty(count)
    for e in range(count):
        lag, ratio, height = _gated_peak(correlation[e], gates[e])
        i, j = edges[e]
        arrivals[j] = arrivals[i] + lag * stretch
        ambiguity = max(ambiguity, ratio)
        # Padding makes the bins dependent. The number of independent bins is therefore
        # smaller than that of the summed bins.
        heights[e] = height / (math.sqrt(2.0 * padding * moments[e, 0]) + 1e-300)
        rms_bin = math.sqrt(moments[e, 1] / (moments[e, 0] + 1e-300))
        counts[e] = 2.0 * gates[e] / grid * rms_bin
    chance, weakest = _chance_of_noise(heights, counts)
    return arrivals, ambiguity, chance, weakest


def weakest_sound(plan: DelayPlan, rate: float) -> float:
    """Computes the level of the weakest sound that can be distinguished from noise.

    Let sounds have equal energy but different spectra. The sound with the spectrum of
    the noise then has the highest correlation relative to noise (Cauchy-Schwarz
    inequality). The weakest sound therefore has this spectrum.

    Args:
        plan: Rates, band and array.
        rate: Largest probability that noise alone is taken for a sound.

    Returns:
        Ratio of the energy of the sound to the energy of the noise, within the band.
    """
    from scipy.optimize import brentq

    bins = np.arange(plan.band.start, plan.band.stop)
    counts = 2.0 * plan.gates / plan.grid * math.sqrt(np.mean(bins**2.0))

    def excess(z: float) -> float:
        return _chance_of_noise(np.full(len(counts), z), counts)[0] - rate

    z = brentq(excess, 0.0, _HIGHEST) if excess(0.0) > 0.0 else 0.0
    independent = 2.0 * len(bins) * plan.frame_samples / plan.length
    coherence = min(z / math.sqrt(independent), _WHOLE)
    return coherence / (1.0 - coherence)


def _correlation_search(
    cross: NDArray[np.complex64],
    moments: NDArray[np.float64],
    energy: float,
    plan: DelayPlan,
) -> DelaySearch:
    padding = plan.length / plan.frame_samples
    stretch = plan.length / plan.grid
    arrivals, ambiguity, chance, weakest = _judge(
        cross, plan.grid, moments, plan.edges, plan.gates, padding, stretch
    )
    return DelaySearch(arrivals, ambiguity, chance, weakest, energy / plan.length)


def _arrivals(lags: NDArray[np.float64], plan: DelayPlan) -> NDArray[np.float64]:
    """Converts the lags along the edges to (n,) arrivals."""
    arrivals = np.zeros(len(lags) + 1)
    for (i, j), lag in zip(plan.edges.tolist(), lags.tolist(), strict=True):
        arrivals[j] = arrivals[i] + lag
    return arrivals


def _amdf_search(
    frame: NDArray[np.float32], plan: DelayPlan
) -> tuple[NDArray[np.float64], float]:
    """Computes the arrivals by ``amdf``, and their ambiguity."""
    lags, ambiguity = np.empty(len(plan.edges)), 0.0
    for e, (i, j) in enumerate(plan.edges.tolist()):
        reach = int(plan.edge_lags[e]) + 1
        difference = amdf(frame[i], frame[j], reach)
        # The depth of a minimum below the mean corresponds to the height of a peak.
        best, ratio = _peak(difference.mean() - difference)
        lags[e] = best - reach
        ambiguity = max(ambiguity, ratio)
    return _arrivals(lags, plan), ambiguity


def search_delays(
    frame: NDArray[np.float32],
    spectra: NDArray[np.complex64],
    plan: DelayPlan,
    band: slice,
    *,
    phat: bool = False,
    by_amdf: bool = False,
) -> DelaySearch | None:
    """Searches a frame of audio for a sound.

    Args:
        frame: (n, frame_samples) channels, any unit.
        spectra: (n, bins) transform of length ``plan.length`` within the band.
        plan: Rates and array.
        band: Bins of the transform that ``spectra`` contains.
        phat: Whether to whiten the cross-spectra.
        by_amdf: Whether ``amdf`` gives the delays. The detection always uses the
            correlation.

    Returns:
        Initial estimates of the times of arrival, and measures of their reliability.
        None if a channel is silent.
    """
    size = plan.grid // 2 + 1
    cross, moments, energy = _cross_spectra(spectra, plan.edges, band.start, size)
    if not energy > 0.0:
        return None
    white = cross.copy() if phat else None
    found = _correlation_search(cross, moments, energy, plan)
    if white is not None:
        # All peaks of a tone are equally high. After whitening, noise decides which one
        # is the highest. The ambiguity is therefore the larger one of both searches.
        # The search without whitening decides whether the frame contains only noise.
        white[:, band] *= whitening(white[:, band])
        seen = _correlation_search(white, moments, energy, plan)
        arrivals, ambiguity = seen.arrivals, max(found.ambiguity, seen.ambiguity)
    elif by_amdf:
        arrivals, ambiguity = _amdf_search(frame, plan)
    else:
        return found
    return found._replace(arrivals=arrivals, ambiguity=ambiguity)
