"""Estimates the delays of nearly aligned channels from many short spectra together.

The estimated delays are those at which the phases of the channels agree best. The
agreement is summed over all pairs of channels, all frequencies and all snapshots, which
are short windows of the recording. If the channels are more coherent at a frequency,
this frequency has a larger weight.

The errors follow from how much frequency bands disagree about the delays. They include
the errors from noise. They include errors from reflections only as far as the
reflections shift the bands differently.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from systems.framework.compiling import njit

_BANDS = 24
_LEAST_BANDS = 4

# Power added before whitening, as a share of the mean power at the frequency. With it,
# weak snapshots count little.
_FLOOR = 1.0

# Factor for the errors from reflections, which also shift all bands equally. The errors
# grow by this share for each part of the sound that is not coherent. The value is from
# simulated rooms with reverberation times of 0.15-0.6 s.
_ECHO_ERROR = 1.0
_STEPS = 12
# The search ends if the steps are below this share of a quarter of the shortest period.
_SETTLED = 1e-4
_MOST_COHERENT = 0.9999


@dataclass(frozen=True)
class AlignedDelays:
    """Estimated delays that remain after the alignment of the channels."""

    tau: NDArray[np.float64]
    """(n - 1,) delays of channels 1 ... n - 1 after channel 0, s."""
    covariance: NDArray[np.float64]
    """(n - 1, n - 1) covariance of the delays, s^2."""
    coherence: float
    """Share of the sound that is in phase in two channels, at most 1. It is the mean
    over all pairs and frequencies. More coherent frequencies have a larger weight in
    the mean."""
    agreement: float = field(default=0.0, kw_only=True)
    """Share of the sound that is in phase in two channels, with equal weights for all
    frequencies. It measures how well the delays explain the whole sound."""


def fit_aligned_delays(
    spectra: NDArray[np.complex64],
    weights: NDArray[np.float32],
    angular_frequency: NDArray[np.float64],
    coarseness: float = 1.0,
) -> AlignedDelays | None:
    """Estimates the delays that remain between channels after a rough alignment.

    Args:
        spectra: (n, k, f) spectra of n channels at f frequencies in k snapshots. A
            snapshot is a short window of the recording. All channels have about the
            same power.
        weights: (k, f) weights of the frequencies of each snapshot, 0 to 1.
        angular_frequency: (f,) increasing angular frequencies, rad/s.
        coarseness: Possible error of the alignment, in tenths of the shortest period.
            If it exceeds 1, the search begins with the lower frequencies only.

    Returns:
        The delays and their errors. None if the channels do not agree on any delays.
    """
    first, second = np.triu_indices(len(spectra), 1)
    power = np.mean(np.abs(spectra) ** 2, axis=0)
    floor = _FLOOR * power.mean(axis=0) + np.finfo(np.float32).tiny
    flat = weights / (power + floor)
    cross = np.einsum(
        "pkf,pkf,kf->pf", spectra[first].conj(), spectra[second], flat, optimize=True
    ).astype(np.complex128)
    total = (flat * power).sum(axis=0).astype(np.float64)
    if not total.any():
        return None
    edges = _band_edges(total)
    tau = np.zeros(len(spectra) - 1)
    even = np.ones(angular_frequency.size)
    while coarseness > 1.0:
        low = (angular_frequency * coarseness < angular_frequency[-1]).astype(float)
        if (low * total).sum() > 0.1 * total.sum():
            tau = _climb(cross, low, angular_frequency, tau)
        coarseness /= 2.0
    tau = _climb(cross, even, angular_frequency, tau)
    gain = _coherence_gain(cross, total, angular_frequency, tau, edges)
    if not gain.any():
        return None
    tau = _climb(cross, gain, angular_frequency, tau)
    slope, curve, aligned = _sums(cross, gain, angular_frequency, tau, edges)
    bands = np.count_nonzero(gain[edges[:-1]])
    if bands < _LEAST_BANDS or np.linalg.eigvalsh(curve)[0] <= 0.0:
        return None
    inverse = np.linalg.inv(curve)
    scatter = slope.T @ slope * bands / (bands - 1)
    scale = float(np.trace(inverse @ scatter)) / tau.size
    coherence = float(aligned / (len(first) * (gain * total).sum()))
    echo = 1.0 + _ECHO_ERROR * (1.0 - min(coherence, 1.0))
    whole = np.array([0, angular_frequency.size])
    in_phase = _sums(cross, even, angular_frequency, tau, whole)[2]
    return AlignedDelays(
        tau=tau,
        covariance=echo**2 * scale * inverse,
        coherence=coherence,
        agreement=float(in_phase / (len(first) * total.sum())),
    )


def _band_edges(total: NDArray[np.float64]) -> NDArray[np.int64]:
    """Returns the edges of frequency bands that have about the same total weight."""
    share = np.cumsum(total) / total.sum()
    edges = np.searchsorted(share, np.arange(1, _BANDS) / _BANDS)
    return np.unique(np.concatenate(([0], edges, [total.size])))


def _coherence_gain(
    cross: NDArray[np.complex128],
    total: NDArray[np.float64],
    w: NDArray[np.float64],
    tau: NDArray[np.float64],
    edges: NDArray[np.int64],
) -> NDArray[np.float64]:
    """Returns (f,) weights r / (1 - r^2) of phases with the coherence r."""
    later = np.concatenate(([0.0], tau))
    first, second = np.triu_indices(later.size, 1)
    turned = cross * np.exp(1j * np.outer(later[second] - later[first], w))
    in_phase = np.add.reduceat(turned.real.mean(axis=0), edges[:-1])
    whole = np.add.reduceat(total, edges[:-1])
    r = np.clip(in_phase / np.maximum(whole, 1e-30), 0.0, _MOST_COHERENT)
    # A coherence that noise alone can reach counts as 0.
    noise = 2.0 / np.sqrt(np.maximum(whole * len(first), 1.0))
    r[r < noise] = 0.0
    return np.repeat(r / (1.0 - r**2), np.diff(edges))


def _climb(
    cross: NDArray[np.complex128],
    gain: NDArray[np.float64],
    w: NDArray[np.float64],
    tau: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Maximizes the agreement by Newton's method, at most a quarter period per step.

    The period is that of the highest frequency with a weight.
    """
    top = w[np.flatnonzero(gain)[-1]]
    limit = 0.5 * math.pi / top
    edges = np.array([0, w.size])
    for _ in range(_STEPS):
        slope, curve, _ = _sums(cross, gain, w, tau, edges)
        try:
            step = np.linalg.solve(curve, slope[0])
        except np.linalg.LinAlgError:
            return tau
        if slope[0] @ step <= 0.0:
            return tau
        step *= min(1.0, limit / np.abs(step).max())
        tau = tau + step
        if np.abs(step).max() < _SETTLED * limit:
            break
    return tau


@njit(cache=True)
def _sums(  # pragma: no cover  (compiled)
    cross: Any, gain: Any, w: Any, tau: Any, edges: Any
) -> tuple[Any, Any, float]:
    """Computes the agreement of the channels and its derivatives.

    The agreement is the sum over all pairs and frequencies of Re(cross e^(j w delay)).
    The results are the (b, n - 1) slopes of the agreement in b bands with respect to
    the delays, its (n - 1, n - 1) negative second derivative, and the agreement itself.
    """
    bands, count = edges.size - 1, tau.size + 1
    slope = np.zeros((bands, count - 1))
    curve = np.zeros((count - 1, count - 1))
    agreement = 0.0
    p = 0
    for i in range(count):
        for j in range(i + 1, count):
            t = tau[j - 1] - (tau[i - 1] if i > 0 else 0.0)
            bend = 0.0
            for b in range(bands):
                rise = 0.0
                for k in range(edges[b], edges[b + 1]):
                    if gain[k] == 0.0:
                        continue
                    angle = w[k] * t
                    cosine, sine = math.cos(angle), math.sin(angle)
                    z = cross[p, k]
                    real = gain[k] * (z.real * cosine - z.imag * sine)
                    imag = gain[k] * (z.real * sine + z.imag * cosine)
                    agreement += real
                    rise -= w[k] * imag
                    bend += w[k] * w[k] * real
                slope[b, j - 1] += rise
                if i > 0:
                    slope[b, i - 1] -= rise
            curve[j - 1, j - 1] += bend
            if i > 0:
                curve[i - 1, i - 1] += bend
                curve[i - 1, j - 1] -= bend
                curve[j - 1, i - 1] -= bend
            p += 1
    return slope, curve, agreement
