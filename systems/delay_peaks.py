"""Sub-sample peaks of the channels' cross-correlations, and their errors."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy import fft

from systems.correlation_peak import refine_peaks
from systems.overlap import EDGE_SAMPLES, cut_rows
from systems.transforms import filled_rows

__all__ = ["PairTables", "Peaks", "find_peaks", "whitening"]

# Weights of PHAT fall to zero where the cross-spectrum is below this share of
# its mean: bins of noise would otherwise weigh as much as bins of sound.
_PHAT_FLOOR = 0.1

# Variance of an arrival that is rounded to whole samples: 1/12 a pair.
_ROUNDING = 1.0 / 24.0


def whitening(cross: NDArray[np.complex64]) -> NDArray[np.float32]:
    """Weights of the phase transform, for (pairs, bins) cross-spectra."""
    size = np.abs(cross)
    floor = _PHAT_FLOOR * size.mean(axis=-1, keepdims=True)
    return 1.0 / (size + floor + np.finfo(np.float32).tiny)


@njit(cache=True)
def _pair_spectra(spectra, pairs):  # pragma: no cover  (compiled)
    """Cross-spectra (p, bins) of pairs of channels, weights 1, and energies (n,)."""
    channels, bins = spectra.shape
    energy = np.zeros(channels)
    for m in range(channels):
        for k in range(bins):
            a = spectra[m, k]
            energy[m] += a.real * a.real + a.imag * a.imag
    cross = np.empty((len(pairs), bins), dtype=spectra.dtype)
    for p in range(len(pairs)):
        i, j = pairs[p]
        for k in range(bins):
            cross[p, k] = spectra[i, k].conjugate() * spectra[j, k]
    return cross, np.ones(cross.shape, dtype=np.float32), energy


class PairTables(NamedTuple):
    """Matrices that join pairs of channels to channels."""

    pairs: NDArray[np.int64]
    """(p, 2) all pairs of n channels."""
    to_delays: NDArray[np.float64]
    """(n - 1, p) least squares from their delays to t_k - t_0."""
    to_shares: NDArray[np.float64]
    """(n, p) least squares from the logarithms of their coherences to those of
    the channels' shares of signal: a coherence is the geometric mean of two
    shares. Exact for three channels."""

    @classmethod
    def of(cls, pairs: NDArray[np.int64]) -> PairTables:
        """The tables of all pairs i < j of some channels."""
        rows = np.arange(len(pairs))
        count = int(pairs.max()) + 1
        first, second = np.zeros((2, len(pairs), count), dtype=np.float64)
        first[rows, pairs[:, 0]] = second[rows, pairs[:, 1]] = 1.0
        return cls(
            pairs,
            np.asarray(np.linalg.pinv((second - first)[:, 1:]), dtype=np.float64),
            np.asarray(np.linalg.pinv(0.5 * (first + second)), dtype=np.float64),
        )


@njit(cache=True)
def arrival_variances(
    r, sums, energy, pairs, to_shares, bins, padding
):  # pragma: no cover  (compiled)
    """(n,) of each channel's time of arrival, samples^2.

    With noise of power n a bin and signal of power s, a correlation's peak moves
    by the noise over its curvature,
    sum w^2 W^2 (s_i n_j + s_j n_i + n_i n_j) / 2 / (sum w^2 W s)^2: for equal
    weights and much signal that is the bound of Knapp and Carter (1976).
    """
    channels = energy.size
    n, s = np.empty(channels), np.empty(channels)
    for m in range(channels):
        exponent = 0.0
        for p in range(len(pairs)):
            exponent += to_shares[m, p] * math.log(min(max(r[p], 1e-3), 1.0))
        q = min(max(math.exp(exponent), 1e-3), 1.0 - 1e-9)
        n[m], s[m] = (1.0 - q) * energy[m] / bins, q * energy[m]
    parts = np.zeros(channels)
    for p in range(len(pairs)):
        i, j = pairs[p]
        curve, squares, noise = sums[p]
        scale = padding / (2.0 * curve * curve * (channels - 1))
        cross = 0.5 * n[i] * n[j] * noise
        # Each channel's part: noise of one against the signal of the other.
        parts[i] += scale * (n[i] * squares * math.sqrt(s[j] / s[i]) + cross)
        parts[j] += scale * (n[j] * squares * math.sqrt(s[i] / s[j]) + cross)
    return parts


@njit(cache=True)
def _reconcile(
    tau, arrivals, pairs, to_delays, reconciled
):  # pragma: no cover  (compiled)
    """Fills in the arrivals that fit all delays best.

    Returns:
        How far they are from the given ones at most, and each delay from them.
    """
    moved, closure = 0.0, 0.0
    reconciled[0] = 0.0
    for m in range(1, reconciled.size):
        reconciled[m] = 0.0
        for p in range(tau.size):
            reconciled[m] += to_delays[m - 1, p] * tau[p]
        moved = max(moved, abs(reconciled[m] - arrivals[m]))
    for p in range(tau.size):
        i, j = pairs[p]
        closure = max(closure, abs(tau[p] - (reconciled[j] - reconciled[i])))
    return moved, closure


@njit(cache=True)
def _measure(
    cross, weights, energy, arrivals, tables, sizes, newton
):  # pragma: no cover  (compiled)
    """Fields of ``Peaks``; a correlation of 0 where there is no peak.

    Args:
        cross: From ``_pair_spectra``.
        weights: (p, bins).
        energy: From ``_pair_spectra``.
        arrivals: See ``find_peaks``.
        tables: ``PairTables``.
        sizes: First bin, length of the transform, samples of the cut channels.
        newton: See ``find_peaks``.
    """
    pairs, to_delays, to_shares = tables
    first, length, cut_samples = sizes
    others = len(energy) - 1
    step = 2.0 * math.pi / length
    whole = np.rint(arrivals)
    start = np.empty(len(pairs))
    for p in range(len(pairs)):
        i, j = pairs[p]
        start[p] = (arrivals[j] - whole[j]) - (arrivals[i] - whole[i])
    tau, plain, agreement, sums = refine_peaks(
        cross, weights, first * step, step, start, newton
    )
    reconciled, covariance = np.empty(others + 1), np.empty((others, others))
    r = np.empty(len(pairs))
    for p in range(len(pairs)):
        i, j = pairs[p]
        tau[p] += whole[j] - whole[i]
        r[p] = plain[p] / max(math.sqrt(energy[i] * energy[j]), 1e-300)
    correlation, angular_frequency, noise_energy = 0.0, 0.0, 0.0
    moved, closure = _reconcile(tau, arrivals, pairs, to_delays, reconciled)
    if r.min() > 0.0 and sums[:, 0].min() > 0.0:
        # The soft edges cost energy: the mean square of a raised cosine is 3/8.
        padding = length / (cut_samples - 1.25 * EDGE_SAMPLES)
        variances = arrival_variances(
            r, sums, energy, pairs, to_shares, cross.shape[1], padding
        )
        if not newton:
            variances += _ROUNDING
        covariance[:] = variances[0]
        for m in range(others):
            covariance[m, m] += variances[m + 1]
        correlation = min(r.min(), agreement.min(), 1.0)
        angular_frequency = math.sqrt((sums[:, 0] / plain).min())
        noise_energy = (1.0 - r.mean()) * energy.mean() / length * padding
    return (
        reconciled,
        covariance,
        correlation,
        angular_frequency,
        noise_energy,
        moved,
        closure,
    )


class Peaks(NamedTuple):
    """Peaks of all pairs' correlations."""

    arrivals: NDArray[np.float64]
    """(n,) arrival at each channel after channel 0 that fits all delays, samples."""
    covariance: NDArray[np.float64]
    """(n - 1, n - 1) of the arrivals after the first one, samples^2."""
    correlation: float
    """Least correlation coefficient of the pairs, 0 to 1."""
    angular_frequency: float
    """Root mean square of what the channels share, rad a sample; least of the pairs."""
    noise_energy: float
    """Of what the mean channel does not share with the others, within the band,
    units of the frame squared."""
    moved: float
    """Largest change of an arrival, samples."""
    closure: float
    """Largest disagreement of a pair's own delay with ``arrivals``, samples."""


def find_peaks(
    frame: NDArray[np.float32],
    arrivals: NDArray[np.float64],
    tables: PairTables,
    *,
    length: int,
    band: slice,
    phat: bool = False,
    newton: bool = True,
) -> Peaks | None:
    """Peaks of the cross-correlations near given delays.

    Args:
        frame: (n, samples) channels.
        arrivals: (n,) arrival at each channel after channel 0, samples.
        tables: The pairs of channels.
        length: Of the Fourier transform, at least that of the frame.
        band: Its bins to use.
        phat: Whether to whiten.
        newton: Whether to search between the samples.

    Returns:
        The peaks, or None where there is none.
    """
    rows = filled_rows(len(frame))
    cut, cut_samples = cut_rows(frame, np.rint(arrivals), rows, length)
    spectra = fft.rfft(cut)[: len(frame), band]
    cross, weights, energy = _pair_spectra(spectra, tables.pairs)
    if phat:
        weights = whitening(cross)
    peaks = Peaks(
        *_measure(
            cross,
            weights,
            energy,
            arrivals,
            tables,
            (band.start, length, cut_samples),
            newton,
        )
    )
    return peaks if peaks.correlation > 0.0 else None
