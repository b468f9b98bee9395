"""Delays of channels that are nearly aligned, from many short spectra at once.

The delays are those that make the channels agree best in phase, over all
pairs, snapshots and frequencies. Frequencies where the channels agree count
more. How much the bands of frequencies disagree on the delays gives the errors
that noise makes, and reflections, as far as they move bands apart.
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

# Added to the power that whitens, as a share of the frequency's mean: what is
# weak says little.
_FLOOR = 1.0

# Reflections move bands alike as well as apart: by how much the errors are
# larger than the bands' disagreement, for each part that is not coherent.
# From simulated rooms with reverberation times of 0.15-0.6 s.
_ECHO_ERROR = 1.0
_STEPS = 12
_SETTLED = 1e-4  # of the period of the highest frequency
_MOST_COHERENT = 0.9999


@dataclass(frozen=True)
class AlignedDelays:
    """What is left of the delays after the alignment."""

    tau: NDArray[np.float64]
    """(n - 1,) of channels 1 ... n - 1 against channel 0, s."""
    covariance: NDArray[np.float64]
    """(n - 1, n - 1), s^2."""
    coherence: float
    """Mean over pairs and frequencies of the part in phase, at most 1; frequencies
    count as far as they are coherent."""
    agreement: float = field(default=0.0, kw_only=True)
    """The same with all frequencies alike: how well these delays explain all."""


def fit_aligned_delays(
    spectra: NDArray[np.complex64],
    weights: NDArray[np.float32],
    angular_frequency: NDArray[np.float64],
    coarseness: float = 1.0,
) -> AlignedDelays | None:
    """Delays of aligned channels.

    Args:
        spectra: (n, k, f) of k snapshots of n channels, each about as large.
        weights: (k, f) of the snapshots' frequencies, 0 to 1.
        angular_frequency: (f,) rad/s, rising.
        coarseness: By how much the alignment may be off, against a tenth of
            the shortest period: the search begins at lower frequencies.

    Returns:
        The delays, or None where the channels do not agree.
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
    """Edges of bands that hold about the same weight."""
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
    """(f,) weights of phases with coherence r: r / (1 - r^2)."""
    later = np.concatenate(([0.0], tau))
    first, second = np.triu_indices(later.size, 1)
    turned = cross * np.exp(1j * np.outer(later[second] - later[first], w))
    in_phase = np.add.reduceat(turned.real.mean(axis=0), edges[:-1])
    whole = np.add.reduceat(total, edges[:-1])
    r = np.clip(in_phase / np.maximum(whole, 1e-30), 0.0, _MOST_COHERENT)
    # What noise alone would reach is nothing.
    noise = 2.0 / np.sqrt(np.maximum(whole * len(first), 1.0))
    r[r < noise] = 0.0
    return np.repeat(r / (1.0 - r**2), np.diff(edges))


def _climb(
    cross: NDArray[np.complex128],
    gain: NDArray[np.float64],
    w: NDArray[np.float64],
    tau: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Newton's method, kept within a quarter of the shortest period a step."""
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
    """Derivatives of the agreement, sum over pairs of Re(cross e^(j w delay)).

    Returns:
        The slope of each band (b, n - 1), minus the second derivative of all
        (n - 1, n - 1), and the agreement itself.
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
