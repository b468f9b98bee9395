"""Sub-sample peaks of the channels' cross-correlations, and their errors."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy import fft

__all__ = [
    "EDGE_SAMPLES",
    "PairTables",
    "Peaks",
    "cut_to_overlap",
    "find_peaks",
    "whitening",
]

# Weights of PHAT fall to zero where the cross-spectrum is below this share of
# its mean: bins of noise would otherwise weigh as much as bins of sound.
_PHAT_FLOOR = 0.1

# Newton's method: largest number of steps, and the step at which it ends.
_ITERATIONS = 10
_TOLERANCE = 1e-6

#: Raised-cosine edges of the cut channels, samples. Sharp edges pull a peak to
#: whole samples by one over the length and the squared bandwidth: 4e-3 samples of
#: a 25 ms frame, as much as the noise at 30 dB. These leave a twentieth of it, and
#: nothing where they follow the delays below the sample.
EDGE_SAMPLES = 16


def whitening(cross: NDArray[np.complex64]) -> NDArray[np.float32]:
    """Weights of the phase transform, for (pairs, bins) cross-spectra."""
    size = np.abs(cross)
    floor = _PHAT_FLOOR * size.mean(axis=-1, keepdims=True)
    return 1.0 / (size + floor + np.finfo(np.float32).tiny)


def _ramp(rests: NDArray[np.float64]) -> NDArray[np.float32]:
    """(n, EDGE_SAMPLES) rising edges that begin late by some part of a sample."""
    place = np.arange(EDGE_SAMPLES) + 0.5 - rests[:, np.newaxis]
    share = np.clip(place / EDGE_SAMPLES, 0.0, 1.0)
    return (0.5 - 0.5 * np.cos(np.pi * share)).astype(np.float32)


_EVEN_RAMPS = _ramp(np.zeros(1)), _ramp(np.zeros(1))


def cut_to_overlap(
    frame: NDArray[np.float32], arrivals: NDArray[np.float64]
) -> NDArray[np.float32]:
    """(n, m) the stretch that all channels share, with soft edges.

    Args:
        frame: (n, samples) channels.
        arrivals: (n,) arrival at each channel after channel 0, samples. Channels
            are cut at whole samples; their edges follow what is left of it.
    """
    whole = np.rint(arrivals)
    rests = arrivals - whole
    starts = (whole - whole.min()).astype(np.int64)
    rising, falling = (_ramp(rests), _ramp(-rests)) if rests.any() else _EVEN_RAMPS
    return _cut(frame, starts, rising, falling)


@njit(cache=True)
def _cut(frame, starts, rising, falling):  # pragma: no cover  (compiled)
    """``cut_to_overlap`` from starts, and edges that are alike or one a channel."""
    channels, samples = frame.shape
    length = samples - starts.max()
    cut = np.empty((channels, length), dtype=frame.dtype)
    edge = rising.shape[1] if length >= 2 * rising.shape[1] else 0
    for m in range(channels):
        ramp = m if rising.shape[0] > 1 else 0
        cut[m] = frame[m, starts[m] : starts[m] + length]
        for k in range(edge):
            cut[m, k] *= rising[ramp, k]
            cut[m, length - 1 - k] *= falling[ramp, k]
    return cut


@njit(cache=True)
def _pair_spectra(spectra, pairs):  # pragma: no cover  (compiled)
    """Cross-spectra (p, bins) of pairs of channels, and energies (n,)."""
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
    return cross, energy


@njit(cache=True)
def _refine(cross, weights, first, step, start, newton):  # pragma: no cover  (compiled)
    """Peaks of weighted cross-correlations, and sums for their errors.

    Args:
        cross: (p, n) cross-spectra of the pairs.
        weights: (p, n) W.
        first: Angular frequency of the first bin, rad a sample.
        step: From bin to bin, rad a sample.
        start: (p,) where the search begins, samples.
        newton: Whether to search, or to stay there.

    Returns:
        tau (p,) in samples. With z the cross-spectrum turned back by tau:
        the sum of Re(z) (p,); the share of sum W |z| that is in phase (p,);
        and sums (p, 3) of w^2 W Re(z), w^2 W^2 Re(z) and w^2 W^2.
    """
    pairs, bins = cross.shape
    tau = np.zeros(pairs)
    plain = np.zeros(pairs)
    agreement = np.zeros(pairs)
    sums = np.zeros((pairs, 3))
    for p in range(pairs):
        t = start[p]
        for _ in range(_ITERATIONS):
            slope, aligned, total = 0.0, 0.0, 0.0
            plain[p] = 0.0
            sums[p] = 0.0
            turn = complex(math.cos(first * t), math.sin(first * t))
            advance = complex(math.cos(step * t), math.sin(step * t))
            w = first
            for k in range(bins):
                z = cross[p, k] * turn
                weight = weights[p, k]
                slope -= w * weight * z.imag
                plain[p] += z.real
                aligned += weight * z.real
                total += weight * math.sqrt(z.real * z.real + z.imag * z.imag)
                sums[p, 0] += w * w * weight * z.real
                sums[p, 1] += w * w * weight * weight * z.real
                sums[p, 2] += w * w * weight * weight
                turn *= advance
                w += step
            tau[p] = t
            agreement[p] = aligned / max(total, 1e-300)
            curve = sums[p, 0]
            if not newton or curve <= 0.0:
                break
            move = min(max(slope / curve, -0.5), 0.5)
            if abs(move) < _TOLERANCE:
                break
            t += move
    return tau, plain, agreement, sums


@dataclass(frozen=True, eq=False)
class PairTables:
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


def arrival_variances(
    r: NDArray[np.float64],
    sums: NDArray[np.float64],
    energy: NDArray[np.float64],
    tables: PairTables,
    bins: int,
    padding: float,
) -> NDArray[np.float64]:
    """(n,) of each channel's time of arrival, samples^2.

    With noise of power n a bin and signal of power s, a correlation's peak moves
    by the noise over its curvature,
    sum w^2 W^2 (s_i n_j + s_j n_i + n_i n_j) / 2 / (sum w^2 W s)^2: for equal
    weights and much signal that is the bound of Knapp and Carter (1976).
    """
    shares = np.exp(tables.to_shares @ np.log(np.clip(r, 1e-3, 1.0)))
    return padding * _arrival_variances(shares, sums, energy, tables.pairs, bins)


@njit(cache=True)
def _arrival_variances(
    shares, sums, energy, pairs, bins
):  # pragma: no cover  (compiled)
    channels = energy.size
    n, s = np.empty(channels), np.empty(channels)
    for m in range(channels):
        q = min(max(shares[m], 1e-3), 1.0 - 1e-9)
        n[m], s[m] = (1.0 - q) * energy[m] / bins, q * energy[m]
    parts = np.zeros(channels)
    for p in range(len(pairs)):
        i, j = pairs[p]
        curve, squares, noise = sums[p]
        scale = 1.0 / (2.0 * curve * curve)
        cross = 0.5 * n[i] * n[j] * noise
        # Each channel's part: noise of one against the signal of the other.
        parts[i] += scale * (n[i] * squares * math.sqrt(s[j] / s[i]) + cross)
        parts[j] += scale * (n[j] * squares * math.sqrt(s[i] / s[j]) + cross)
    return parts / (channels - 1)


@dataclass(frozen=True)
class Peaks:
    """Peaks of all pairs' correlations."""

    tau: NDArray[np.float64]
    """(p,) delays of the pairs, samples."""
    variances: NDArray[np.float64]
    """(n,) of each channel's time of arrival, samples^2."""
    correlation: float
    """Least correlation coefficient of the pairs, 0 to 1."""
    angular_frequency: float
    """Root mean square of what the channels share, rad a sample; least of the pairs."""
    noise_energy: float
    """Of what the mean channel does not share with the others, within the band,
    units of the frame squared."""


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
    whole = np.rint(arrivals)
    cut = cut_to_overlap(frame, whole)
    spectra = fft.rfft(cut, length)[:, band]
    cross, energy = _pair_spectra(spectra, tables.pairs)
    if not energy.min() > 0.0:
        return None
    first, second = tables.pairs.T
    weights = whitening(cross) if phat else np.ones(cross.shape, dtype=np.float32)
    step = 2.0 * math.pi / length
    rest = arrivals - whole
    tau, plain, agreement, sums = _refine(
        cross, weights, band.start * step, step, rest[second] - rest[first], newton
    )
    r = plain / np.sqrt(energy[first] * energy[second])
    if not (r.min() > 0.0 and sums[:, 0].min() > 0.0):
        return None
    # The soft edges cost energy: the mean square of a raised cosine is 3/8.
    padding = length / (cut.shape[1] - 1.25 * EDGE_SAMPLES)
    correlation = min(r.min(), agreement.min() if phat else 1.0, 1.0)
    return Peaks(
        tau=tau + (whole[second] - whole[first]),
        variances=arrival_variances(r, sums, energy, tables, spectra.shape[1], padding),
        correlation=float(correlation),
        angular_frequency=math.sqrt(float((sums[:, 0] / plain).min())),
        noise_energy=float((1.0 - r.mean()) * energy.mean() / length * padding),
    )
