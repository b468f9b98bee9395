"""Delays between three microphones in a row, from one frame of their sound.

A method first finds the delays of the two neighbouring pairs on a grid. Then
the three channels are cut to the stretch that they share, so that the edges
of the frame do not bend the result, and the peak of their cross-correlation is
found by Newton's method on the cross-spectrum. The coherence of the cut
channels gives the errors of the delays.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy import fft

__all__ = ["METHODS", "DelayEstimate", "DelayPlan", "amdf", "estimate_delays"]

#: Pairs of channels: tau_12, tau_23, tau_13.
_PAIRS = np.array([[0, 1], [1, 2], [0, 2]])

# Weights of PHAT fall to zero where the cross-spectrum is below this share of
# its mean: bins of noise would otherwise weigh as much as bins of sound.
_PHAT_FLOOR = 0.1

# Samples a period of the highest frequency on the grid of the first search.
_GRID_DENSITY = 5.0

# The channels are cut again when a delay has moved by more than this, samples.
_SETTLED = 0.75
_CUTS = 4

# Left of a frame after the cut, as a share; a longer delay cannot be measured.
_LEAST_OVERLAP = 0.25


@dataclass(frozen=True)
class DelayPlan:
    """What can be worked out before the first frame.

    Raises:
        ValueError: Band, frame and spacing do not fit the sample rate.
    """

    sample_rate_hz: float
    """Rate of the frames, Hz."""
    frame_samples: int
    """Length of the frames."""
    max_delay_s: float
    """Largest delay between neighbours, spacing / c, s."""
    low_hz: float
    """Lower end of the band, Hz."""
    high_hz: float
    """Upper end of the band, Hz."""

    def __post_init__(self) -> None:
        if not 0.0 < self.low_hz < self.high_hz <= self.sample_rate_hz / 2:
            raise ValueError(
                f"band: {self.low_hz:g} ... {self.high_hz:g} Hz must rise and end at "
                f"or below half the sample rate of {self.sample_rate_hz:g} Hz; lower "
                "the band or record at a higher rate"
            )
        if 2 * self.max_lag > (1.0 - _LEAST_OVERLAP) * self.frame_samples:
            raise ValueError(
                f"spacing: sound needs {self.max_delay_s * 1e3:.2f} ms from microphone "
                f"to microphone, too long for frames of {self.frame_samples} samples; "
                "use longer frames"
            )

    @property
    def max_lag(self) -> int:
        """Largest delay between neighbours, samples."""
        return math.ceil(self.max_delay_s * self.sample_rate_hz)

    @cached_property
    def length(self) -> int:
        """Samples of the Fourier transform, padded so that lags do not wrap."""
        least = self.frame_samples + self.max_lag + 2
        return int(fft.next_fast_len(least, real=True))

    @cached_property
    def band(self) -> slice:
        """Bins of the transform within the band."""
        bins = self.length / self.sample_rate_hz
        first = max(1, math.ceil(self.low_hz * bins))
        return slice(first, min(self.length // 2, math.floor(self.high_hz * bins)) + 1)

    @cached_property
    def grid(self) -> int:
        """Samples of the correlation in the first search."""
        least = math.ceil(_GRID_DENSITY * self.band.stop)
        return int(fft.next_fast_len(least, real=True))

    @cached_property
    def gate(self) -> int:
        """Largest lag on that grid, one more than sound can take."""
        return math.ceil(self.max_lag * self.grid / self.length) + 1


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


def _weights(cross: NDArray[np.complex64], *, phat: bool) -> NDArray[np.float32]:
    if not phat:
        return np.ones(cross.shape, dtype=np.float32)
    size = np.abs(cross)
    floor = _PHAT_FLOOR * size.mean(axis=-1, keepdims=True)
    return 1.0 / (size + floor + np.finfo(np.float32).tiny)


def _search_gcc(
    frame: NDArray[np.float32], plan: DelayPlan, *, phat: bool
) -> tuple[NDArray[np.float64], float]:
    spectra = fft.rfft(frame, plan.length)[:, plan.band]
    cross = spectra[:2].conj() * spectra[1:]
    lags, ambiguity = _correlation_peaks(cross, plan)
    if phat:
        # Whitening breaks the tie of a tone's peaks by noise: the ambiguity of
        # the plain correlation counts as well.
        white = cross * _weights(cross, phat=True)
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


METHODS = {
    "gcc": _Method(lambda f, p: _search_gcc(f, p, phat=False), False, False),
    "gcc_phat": _Method(lambda f, p: _search_gcc(f, p, phat=True), True, False),
    "amdf": _Method(_search_amdf, False, True),
}


def _cut(frame: NDArray[np.float32], lags: NDArray[np.int64]) -> NDArray[np.float32]:
    """(3, m) the stretch that all channels share, given lags of 2 and 3 on 1."""
    starts = np.array([0, lags[0], lags[0] + lags[1]])
    starts -= starts.min()
    length = frame.shape[1] - int(starts.max())
    return np.stack([frame[k, s : s + length] for k, s in enumerate(starts)])


@njit(cache=True)
def _refine(
    spectra, weights, pairs, first, step, start, newton
):  # pragma: no cover  (compiled)
    """Peaks of the weighted cross-correlations, and sums for their errors.

    Args:
        spectra: (3, n) of the cut channels.
        weights: (3, n) of the pairs' cross-spectra.
        pairs: (3, 2) channels of each pair.
        first: Angular frequency of the first bin, rad a sample.
        step: From bin to bin, rad a sample.
        start: (3,) where the search begins, samples.
        newton: Whether to search, or to stay there.

    Returns:
        tau (3,) in samples; correlation coefficients r (3,), without
        weights; the share of the weighted cross-spectrum that is in phase (3,);
        for each pair (3, 3) the sums over the bins of w^2 W Re(z),
        w^2 W^2 Re(z) and w^2 W^2, where z is the cross-spectrum turned back by
        tau; and the energies of the channels (3,).
    """
    tau = np.zeros(3)
    r = np.zeros(3)
    agreement = np.zeros(3)
    sums = np.zeros((3, 3))
    bins = spectra.shape[1]
    energy = np.zeros(3)
    for m in range(3):
        for k in range(bins):
            energy[m] += spectra[m, k].real ** 2 + spectra[m, k].imag ** 2
    for p in range(3):
        i, j = pairs[p, 0], pairs[p, 1]
        t = start[p]
        for _ in range(10):
            slope, curve, plain = 0.0, 0.0, 0.0
            aligned, total = 0.0, 0.0
            squares, noise = 0.0, 0.0
            turn = complex(math.cos(first * t), math.sin(first * t))
            advance = complex(math.cos(step * t), math.sin(step * t))
            w = first
            for k in range(bins):
                z = spectra[i, k].conjugate() * spectra[j, k] * turn
                weight = weights[p, k]
                slope -= w * weight * z.imag
                curve += w * w * weight * z.real
                plain += z.real
                aligned += weight * z.real
                total += weight * abs(z)
                squares += w * w * weight * weight * z.real
                noise += w * w * weight * weight
                turn *= advance
                w += step
            tau[p] = t
            r[p] = plain / math.sqrt(energy[i] * energy[j])
            agreement[p] = aligned / total
            sums[p, 0], sums[p, 1], sums[p, 2] = curve, squares, noise
            if not newton or curve <= 0.0:
                break
            move = min(max(slope / curve, -0.5), 0.5)
            if abs(move) < 1e-6:
                break
            t += move
    return tau, r, agreement, sums, energy


def _delay_covariance(
    r: NDArray[np.float64],
    sums: NDArray[np.float64],
    energy: NDArray[np.float64],
    bins: int,
    padding: float,
) -> NDArray[np.float64]:
    """(2, 2) of tau_12 and tau_13 in samples^2.

    Each pair's coherence is the product of two channels' shares of signal, so
    three pairs give the three shares q. With noise of power n a bin and signal
    of power s, a correlation's peak moves by the noise over its curvature,
    sum w^2 W^2 (s_i n_j + s_j n_i + n_i n_j) / 2 / (sum w^2 W s)^2: for equal
    weights and much signal that is the bound of Knapp and Carter (1976).
    """
    r = np.clip(r, 1e-3, 1.0)
    q = np.array([r[0] * r[2] / r[1], r[0] * r[1] / r[2], r[1] * r[2] / r[0]])
    q = np.clip(q, 1e-3, 1.0 - 1e-9)
    n = (1.0 - q) * energy / bins
    s = q * energy
    parts = np.zeros(3)
    for p, (i, j) in enumerate(_PAIRS):
        curve, squares, noise = sums[p]
        scale = padding / (2.0 * curve * curve)
        cross = 0.5 * n[i] * n[j] * noise
        # Each channel's part: noise of one against the signal of the other.
        parts[i] += 0.5 * scale * (n[i] * squares * math.sqrt(s[j] / s[i]) + cross)
        parts[j] += 0.5 * scale * (n[j] * squares * math.sqrt(s[i] / s[j]) + cross)
    return np.array([[parts[0] + parts[1], parts[0]], [parts[0], parts[0] + parts[2]]])


@dataclass(frozen=True)
class _Peaks:
    """Peaks of the three pairs' correlations, in samples."""

    tau: NDArray[np.float64]
    covariance: NDArray[np.float64]
    correlation: float


def _peaks(
    frame: NDArray[np.float32],
    plan: DelayPlan,
    lags: NDArray[np.float64],
    method: _Method,
) -> _Peaks | None:
    """Peaks near the lags of the neighbouring pairs; None where there is none."""
    whole = np.rint(lags).astype(np.int64)
    cut = _cut(frame, whole)
    spectra = fft.rfft(cut, plan.length)[:, plan.band]
    cross = spectra[_PAIRS[:, 0]].conj() * spectra[_PAIRS[:, 1]]
    weights = _weights(cross, phat=method.phat)
    step = 2.0 * math.pi / plan.length
    rest = np.array([*(lags - whole), np.sum(lags - whole)])
    tau, r, agreement, sums, energy = _refine(
        spectra,
        weights,
        _PAIRS,
        plan.band.start * step,
        step,
        rest,
        not method.whole_samples,
    )
    if not (energy.min() > 0.0 and r.min() > 0.0 and sums[:, 0].min() > 0.0):
        return None
    padding = plan.length / cut.shape[1]
    return _Peaks(
        tau=tau + np.array([*whole, whole.sum()]),
        covariance=_delay_covariance(r, sums, energy, spectra.shape[1], padding),
        correlation=min(r.min(), agreement.min()) if method.phat else r.min(),
    )


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
        peaks = _peaks(frame, plan, lags, chosen)
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
