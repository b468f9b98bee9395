"""Sub-sample peaks of three channels' cross-correlations, and their errors."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy import fft

__all__ = ["PAIRS", "Peaks", "cut_to_overlap", "find_peaks", "whitening"]

#: Pairs of channels: 12, 23 and 13.
PAIRS = np.array([[0, 1], [1, 2], [0, 2]])

# Weights of PHAT fall to zero where the cross-spectrum is below this share of
# its mean: bins of noise would otherwise weigh as much as bins of sound.
_PHAT_FLOOR = 0.1

# Newton's method: largest number of steps, and the step at which it ends.
_ITERATIONS = 10
_TOLERANCE = 1e-6


def whitening(cross: NDArray[np.complex64]) -> NDArray[np.float32]:
    """Weights of the phase transform, for (pairs, bins) cross-spectra."""
    size = np.abs(cross)
    floor = _PHAT_FLOOR * size.mean(axis=-1, keepdims=True)
    return 1.0 / (size + floor + np.finfo(np.float32).tiny)


def cut_to_overlap(
    frame: NDArray[np.float32], lags: NDArray[np.int64]
) -> NDArray[np.float32]:
    """(3, m) the stretch that all channels share, given lags of 2 and 3 on 1."""
    starts = np.array([0, lags[0], lags[0] + lags[1]])
    starts -= starts.min()
    length = frame.shape[1] - int(starts.max())
    return np.stack([frame[k, s : s + length] for k, s in enumerate(starts)])


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


def delay_covariance(
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
    for p, (i, j) in enumerate(PAIRS):
        curve, squares, noise = sums[p]
        scale = padding / (2.0 * curve * curve)
        cross = 0.5 * n[i] * n[j] * noise
        # Each channel's part: noise of one against the signal of the other.
        parts[i] += 0.5 * scale * (n[i] * squares * math.sqrt(s[j] / s[i]) + cross)
        parts[j] += 0.5 * scale * (n[j] * squares * math.sqrt(s[i] / s[j]) + cross)
    return np.array([[parts[0] + parts[1], parts[0]], [parts[0], parts[0] + parts[2]]])


@dataclass(frozen=True)
class Peaks:
    """Peaks of the three pairs' correlations."""

    tau: NDArray[np.float64]
    """(3,) delays of the pairs 12, 23 and 13, samples."""
    covariance: NDArray[np.float64]
    """(2, 2) of tau_12 and tau_13, samples^2."""
    correlation: float
    """Least correlation coefficient of the pairs, 0 to 1."""


def find_peaks(
    frame: NDArray[np.float32],
    lags: NDArray[np.float64],
    *,
    length: int,
    band: slice,
    phat: bool = False,
    newton: bool = True,
) -> Peaks | None:
    """Peaks of the cross-correlations near given lags.

    Args:
        frame: (3, n) channels.
        lags: (2,) delays of the neighbouring pairs, samples.
        length: Of the Fourier transform, at least n.
        band: Its bins to use.
        phat: Whether to whiten.
        newton: Whether to search between the samples.

    Returns:
        The peaks, or None where there is none.
    """
    whole = np.rint(lags).astype(np.int64)
    cut = cut_to_overlap(frame, whole)
    spectra = fft.rfft(cut, length)[:, band]
    energy = np.asarray(np.sum(np.abs(spectra) ** 2, axis=1, dtype=np.float64))
    if not energy.min() > 0.0:
        return None
    cross = spectra[PAIRS[:, 0]].conj() * spectra[PAIRS[:, 1]]
    weights = whitening(cross) if phat else np.ones(cross.shape, dtype=np.float32)
    step = 2.0 * math.pi / length
    rest = np.array([*(lags - whole), np.sum(lags - whole)])
    tau, plain, agreement, sums = _refine(
        cross, weights, band.start * step, step, rest, newton
    )
    r = plain / np.sqrt(energy[PAIRS[:, 0]] * energy[PAIRS[:, 1]])
    if not (r.min() > 0.0 and sums[:, 0].min() > 0.0):
        return None
    padding = length / cut.shape[1]
    return Peaks(
        tau=tau + np.array([*whole, whole.sum()]),
        covariance=delay_covariance(r, sums, energy, spectra.shape[1], padding),
        correlation=float(min(r.min(), agreement.min() if phat else 1.0, 1.0)),
    )
