"""Delays between three microphones in a row, from one frame of their sound.

A method first finds the delays of the two neighbouring pairs on a grid. Then
the three channels are cut to the stretch that they share, so that the edges
of the frame do not bend the result, and the peak of their cross-correlation is
found by Newton's method on the cross-spectrum. The coherence of the cut
channels gives the errors of the delays.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy import fft

from systems.delay_peaks import find_peaks, whitening
from systems.delay_plan import DelayPlan

__all__ = ["METHODS", "DelayEstimate", "DelayPlan", "amdf", "estimate_delays"]

# The channels are cut again when a delay has moved by more than this, samples.
_SETTLED = 0.75
_CUTS = 4


@dataclass(frozen=True)
class DelayEstimate:
    """Delays of one frame and what speaks for them."""

    tau_12: float
    """s; positive when the sound reaches the first channel earlier."""
    tau_13: float
    """s."""
    covariance: NDArray[np.float64]
    """(2, 2) of the two, s^2."""
    correlation: float
    """Least correlation coefficient of the three pairs, 0 to 1."""
    closure: float
    """|tau_12 + tau_23 - tau_13| before the three are reconciled, s."""
    ambiguity: float
    """Second peak over first within the gate, 0 to 1; worst pair."""


def amdf(
    x_i: NDArray[np.float32], x_j: NDArray[np.float32], max_lag: int
) -> NDArray[np.float64]:
    """Average magnitude difference of two channels (Han 2019, eq. 4-6).

    The papers maximise 1 / sum_k |x_i(k) - x_j(k + lag)| over lag = 0 ... n-1.
    Here the sum itself is minimised, so that equal signals do no harm; both
    signs of the lag are searched; and the sum is divided by the number of its
    terms, for the printed one favours large lags.

    Args:
        x_i: (n,) samples.
        x_j: (n,) samples.
        max_lag: Largest lag, below n.

    Returns:
        (2 max_lag + 1,) for the lags -max_lag ... max_lag. The minimum stands
        at the delay t_j - t_i.
    """
    return _amdf(np.ascontiguousarray(x_i), np.ascontiguousarray(x_j), max_lag)


@njit(cache=True, fastmath={"reassoc", "contract", "nsz"})
def _amdf(x_i, x_j, max_lag):  # pragma: no cover  (compiled)
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
def _peak(values):  # pragma: no cover  (compiled)
    """Place of the highest value, and the next peak's height over it.

    The main lobe ends on either side where the values have fallen below half
    the peak. A peak on the border is no peak: its ambiguity is 1.
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


def _search_gcc(
    frame: NDArray[np.float32], plan: DelayPlan, *, phat: bool
) -> tuple[NDArray[np.float64], float]:
    spectra = fft.rfft(frame, plan.length)[:, plan.band]
    cross = spectra[:2].conj() * spectra[1:]
    lags, ambiguity = _correlation_peaks(cross, plan)
    if phat:
        # Whitening breaks the tie of a tone's peaks by noise: the ambiguity of
        # the plain correlation counts as well.
        white = cross * whitening(cross)
        lags, ambiguity_white = _correlation_peaks(white, plan)
        ambiguity = max(ambiguity, ambiguity_white)
    return lags, ambiguity


def _correlation_peaks(
    cross: NDArray[np.complex64], plan: DelayPlan
) -> tuple[NDArray[np.float64], float]:
    whole = np.zeros((2, plan.grid // 2 + 1), dtype=np.complex64)
    whole[:, plan.band] = cross
    correlation = fft.irfft(whole, plan.grid, overwrite_x=True)
    step = plan.length / plan.grid
    lags, ambiguity = np.empty(2), 0.0
    for k in range(2):
        gated = np.concatenate(
            (correlation[k, -plan.gate :], correlation[k, : plan.gate + 1])
        )
        best, ratio = _peak(gated)
        lags[k] = (best - plan.gate) * step
        ambiguity = max(ambiguity, ratio)
    return lags, ambiguity


def _search_amdf(
    frame: NDArray[np.float32], plan: DelayPlan
) -> tuple[NDArray[np.float64], float]:
    lags, ambiguity = np.empty(2), 0.0
    for k in range(2):
        difference = amdf(frame[k], frame[k + 1], plan.max_lag + 1)
        # Its depth below the mean is what a correlation has as height.
        best, ratio = _peak(difference.mean() - difference)
        lags[k] = best - plan.max_lag - 1
        ambiguity = max(ambiguity, ratio)
    return lags, ambiguity


@dataclass(frozen=True)
class _Method:
    search: Callable[
        [NDArray[np.float32], DelayPlan], tuple[NDArray[np.float64], float]
    ]
    """Lags of the neighbouring pairs in samples, and their ambiguity."""
    phat: bool
    """Weights of the cross-spectrum in the second step."""
    whole_samples: bool
    """Whether the delays stay whole samples, as the papers have them."""


#: Ways to measure delays, by name.
METHODS = {
    "gcc": _Method(
        search=lambda frame, plan: _search_gcc(frame, plan, phat=False),
        phat=False,
        whole_samples=False,
    ),
    "gcc_phat": _Method(
        search=lambda frame, plan: _search_gcc(frame, plan, phat=True),
        phat=True,
        whole_samples=False,
    ),
    "amdf": _Method(search=_search_amdf, phat=False, whole_samples=True),
}


def estimate_delays(
    frame: NDArray[np.float32],
    plan: DelayPlan,
    method: str = "gcc",
    *,
    maximum_ambiguity: float = 1.0,
) -> DelayEstimate | None:
    """Delays of a frame.

    Args:
        frame: (3, frame_samples), any unit, first channel at one end of the
            row, last one at the other.
        plan: Rates, band and geometry.
        method: A key of METHODS.
        maximum_ambiguity: Frames beyond it are given up after the search,
            which spares most of the work on frames that hold noise alone.

    Returns:
        The estimate, however poor, or None where a channel is silent, the
        correlation has no peak within the gate, or the frame is given up.
    """
    chosen = METHODS[method]
    if not frame.any(axis=1).all():
        return None
    lags, ambiguity = chosen.search(frame, plan)
    if ambiguity > maximum_ambiguity:
        return None
    for _ in range(_CUTS):
        if np.abs(lags).max() > plan.max_lag + 1:
            return None
        peaks = find_peaks(
            frame,
            lags,
            length=plan.length,
            band=plan.band,
            phat=chosen.phat,
            newton=not chosen.whole_samples,
        )
        if peaks is None:
            return None
        moved = np.abs(peaks.tau[:2] - lags).max()
        lags = peaks.tau[:2]
        if moved < _SETTLED:
            break
    else:
        return None
    covariance = peaks.covariance
    if chosen.whole_samples:
        # Rounding of two arrivals to whole samples: 1/12 a pair.
        covariance = covariance + np.array([[2.0, 1.0], [1.0, 2.0]]) / 24.0
    # Least squares over the three pairs, whose delays must add up.
    tau, rate = peaks.tau, plan.sample_rate_hz
    gap = tau[2] - tau[0] - tau[1]
    return DelayEstimate(
        tau_12=float(tau[0] + gap / 3.0) / rate,
        tau_13=float(tau[2] - gap / 3.0) / rate,
        covariance=covariance / rate**2,
        correlation=float(min(peaks.correlation, 1.0)),
        closure=float(abs(gap)) / rate,
        ambiguity=float(ambiguity),
    )
