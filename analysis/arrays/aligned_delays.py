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

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.diffuse_sound import without_diffuse
from analysis.arrays.phase_agreement import climb, pair_delays, pairs_of, sums

_BANDS = 24
_LEAST_BANDS = 4

# Power added before whitening, as a share of the mean power at the frequency. With it,
# weak snapshots count little.
_FLOOR = 1.0

# Factor for the errors from reflections, which also shift all bands equally. The errors
# grow by this share for each part of the sound that is not coherent. The value is from
# simulated rooms with reverberation times of 0.15-0.6 s.
_ECHO_ERROR = 1.0
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
    diffuse_share: float = field(default=0.0, kw_only=True)
    """Share of diffuse sound, such as reverberation, in the sound without the noise.
    Its effect on the delays is removed."""


def fit_aligned_delays(
    spectra: NDArray[np.complex64],
    weights: NDArray[np.float32],
    angular_frequency: NDArray[np.float64],
    coarseness: float = 1.0,
    *,
    diffuse: NDArray[np.complex64] | None = None,
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
        diffuse: (p, f) coherence of sound from all directions between the p pairs of
            aligned channels. None if there is no such sound.

    Returns:
        The delays and their errors. None if the channels do not agree on any delays.
    """
    first, second = pairs_of(len(spectra))
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
            tau = climb(cross, low, angular_frequency, tau)
        coarseness /= 2.0
    tau = climb(cross, even, angular_frequency, tau)
    gain = _coherence_gain(cross, total, angular_frequency, tau, edges)
    if not gain.any():
        return None
    of_pairs, share = len(first), 0.0
    whole = np.array([0, angular_frequency.size])
    error = np.zeros(tau.size)
    direct = cross
    if diffuse is not None:
        direct, share, error = without_diffuse(
            cross, total, diffuse, angular_frequency, tau, edges
        )
    tau = climb(direct, gain, angular_frequency, tau)
    slope, curve, _ = sums(direct, gain, angular_frequency, tau, edges)
    bands = np.count_nonzero(gain[edges[:-1]])
    if bands < _LEAST_BANDS or np.linalg.eigvalsh(curve)[0] <= 0.0:
        return None
    inverse = np.linalg.inv(curve)
    scatter = slope.T @ slope * bands / (bands - 1)
    scale = float(np.trace(inverse @ scatter)) / tau.size
    aligned = sums(cross, gain, angular_frequency, tau, whole)[2]
    coherence = float(aligned / (of_pairs * (gain * total).sum()))
    echo = 1.0 + _ECHO_ERROR * (1.0 - min(coherence, 1.0))
    in_phase = sums(cross, even, angular_frequency, tau, whole)[2]
    return AlignedDelays(
        tau=tau,
        covariance=echo**2 * scale * inverse + np.outer(error, error),
        coherence=coherence,
        agreement=float(in_phase / (of_pairs * total.sum())),
        diffuse_share=share,
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
    turned = cross * np.exp(1j * np.outer(pair_delays(tau), w))
    in_phase = np.add.reduceat(turned.real.mean(axis=0), edges[:-1])
    whole = np.add.reduceat(total, edges[:-1])
    r = np.clip(in_phase / np.maximum(whole, 1e-30), 0.0, _MOST_COHERENT)
    # A coherence that noise alone can reach counts as 0.
    noise = 2.0 / np.sqrt(np.maximum(whole * len(cross), 1.0))
    r[r < noise] = 0.0
    return np.repeat(r / (1.0 - r**2), np.diff(edges))
