"""Computes the peaks of weighted cross-correlations from cross-spectra, with errors.

All compiled functions that call each other are in this file.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from systems.framework.compiling import njit

# Largest number of Newton steps.
_ITERATIONS = 10
# Step below which the search ends, samples.
_TOLERANCE = 1e-6

# Variance of an arrival due to rounding to whole samples, samples^2. The delay of a
# pair has twice this variance, 1/12.
_ROUNDING = 1.0 / 24.0


@njit(cache=True)
def _turned(
    cross: NDArray[np.complex64],
    first: float,
    step: float,
    t: float,
    real: NDArray[np.float64],
    imaginary: NDArray[np.float64],
) -> None:  # pragma: no cover  (compiled)
    """Multiplies a cross-spectrum (n,) by exp(j w t), where w is the angular frequency.

    The function writes the real part and the imaginary part of the product to ``real``
    and ``imaginary``. It evaluates sines and cosines only for the first bin, and for
    steps of 1, 2, 4, 8 ... bins. The addition theorems give the values of the other
    bins.
    """
    bins = cross.size
    cosine, sine = np.empty(bins), np.empty(bins)
    cosine[0], sine[0] = math.cos(first * t), math.sin(first * t)
    done = 1
    while done < bins:
        c, s = math.cos(step * t * done), math.sin(step * t * done)
        for k in range(min(done, bins - done)):
            cosine[done + k] = cosine[k] * c - sine[k] * s
            sine[done + k] = sine[k] * c + cosine[k] * s
        done *= 2
    for k in range(bins):
        x, y = np.float64(cross[k].real), np.float64(cross[k].imag)
        real[k] = x * cosine[k] - y * sine[k]
        imaginary[k] = x * sine[k] + y * cosine[k]


@njit(cache=True)
def _slope_and_curve(
    real: NDArray[np.float64],
    imaginary: NDArray[np.float64],
    weights: NDArray[np.float32],
    first: float,
    step: float,
) -> tuple[float, float]:  # pragma: no cover  (compiled)
    """Computes the first and the negative second derivative of a correlation.

    The derivatives are those at lag 0. They are sums over the bins of -w W Im(z) and of
    w^2 W Re(z), with the cross-spectrum z, the weights W and the angular frequency w.
    """
    slope, curve = 0.0, 0.0
    for k in range(real.size):
        w = first + k * step
        slope -= w * weights[k] * imaginary[k]
        curve += w * w * weights[k] * real[k]
    return slope, curve


@njit(cache=True)
def _sums(
    real: NDArray[np.float64],
    imaginary: NDArray[np.float64],
    weights: NDArray[np.float32],
    first: float,
    step: float,
) -> tuple[float, float, float, float, float]:  # pragma: no cover  (compiled)
    """Computes the sums of Re(z), W Re(z), W |z|, w^2 W^2 Re(z) and w^2 W^2."""
    plain, aligned, total, squares, noise = 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(real.size):
        w, weight = first + k * step, np.float64(weights[k])
        plain += real[k]
        aligned += weight * real[k]
        total += weight * math.sqrt(real[k] * real[k] + imaginary[k] * imaginary[k])
        squares += (w * weight) ** 2 * real[k]
        noise += (w * weight) ** 2
    return plain, aligned, total, squares, noise


@njit(cache=True)
def _refine(
    cross: NDArray[np.complex64],
    weights: NDArray[np.float32],
    first: float,
    step: float,
    start: NDArray[np.float64],
    newton: Any,
) -> tuple[
    NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]
]:  # pragma: no cover  (compiled)
    """Refines the peaks of weighted cross-correlations by Newton's method.

    The function also computes sums over the bins, from which the errors of the peaks
    follow. In these sums, z is the cross-spectrum after removal of the delay tau, W is
    the weight, and w is the angular frequency.

    Args:
        cross: (p, n) cross-spectra of p pairs of channels.
        weights: (p, n) weights W.
        first: Angular frequency w of the first bin, rad per sample.
        step: Step of w from bin to bin, rad per sample.
        start: (p,) delays at which the search begins, samples.
        newton: Whether to search. If not, the delays stay at ``start``.

    Returns:
        Four arrays:

        - (p,) delays tau, samples;
        - (p,) sums of Re(z);
        - (p,) ratios of the sum of W Re(z) to the sum of W |z|;
        - (p, 3) sums of w^2 W Re(z), of w^2 W^2 Re(z), and of w^2 W^2.
    """
    pairs, bins = cross.shape
    tau, plain, agreement = np.empty(pairs), np.empty(pairs), np.empty(pairs)
    sums = np.empty((pairs, 3))
    real, imaginary = np.empty(bins), np.empty(bins)
    for p in range(pairs):
        t = start[p]
        for _ in range(_ITERATIONS):
            tau[p] = t
            _turned(cross[p], first, step, t, real, imaginary)
            slope, curve = _slope_and_curve(real, imaginary, weights[p], first, step)
            if not newton or curve <= 0.0:
                break
            move = min(max(slope / curve, -0.5), 0.5)
            if abs(move) < _TOLERANCE:
                break
            t += move
        plain[p], aligned, total, squares, noise = _sums(
            real, imaginary, weights[p], first, step
        )
        agreement[p] = aligned / max(total, 1e-300)
        sums[p, 0], sums[p, 1], sums[p, 2] = curve, squares, noise
    return tau, plain, agreement, sums


@njit(cache=True)
def _arrival_variances(
    r: NDArray[np.float64],
    sums: NDArray[np.float64],
    energy: NDArray[np.float64],
    pairs: NDArray[np.int64],
    to_shares: NDArray[np.float64],
    bins: int,
    padding: float,
) -> NDArray[np.float64]:  # pragma: no cover  (compiled)
    """Computes the (n,) variance of each channel's time of arrival, samples^2.

    1. The coherences r of the pairs give the share of signal in each channel. The share
       and the energy give the signal power s_i and the noise power n_i of channel i.
    2. The position of the peak of the pair (i, j) has the variance

           sum w^2 W^2 (s_i n_j + s_j n_i + n_i n_j) / 2 / (sum w^2 W s)^2.

       The sums are over the bins, with the angular frequency w, the weight W, and s =
       sqrt(s_i s_j). For equal weights and a high signal-to-noise ratio, this variance
       is the bound of Knapp and Carter (1976).
    3. Each channel gets the part of this variance that its noise causes.
    """
    channels = energy.size
    # Share q of signal in the energy of each channel, from the coherences r.
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
        # Part of each channel: product of its noise and the other channel's signal.
        parts[i] += scale * (n[i] * squares * math.sqrt(s[j] / s[i]) + cross)
        parts[j] += scale * (n[j] * squares * math.sqrt(s[i] / s[j]) + cross)
    return parts


@njit(cache=True)
def _reconcile(
    tau: NDArray[np.float64],
    arrivals: NDArray[np.float64],
    pairs: NDArray[np.int64],
    to_delays: NDArray[np.float64],
    reconciled: NDArray[np.float64],
) -> tuple[float, float]:  # pragma: no cover  (compiled)
    """Computes the arrivals that fit the delays of all pairs best by least squares.

    The function returns the largest change of an arrival, and the largest disagreement
    between a delay and the arrivals, both in samples.
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
def measure_peaks(
    cross: NDArray[np.complex64],
    weights: NDArray[np.float32],
    energy: NDArray[np.float64],
    arrivals: NDArray[np.float64],
    tables: tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]],
    sizes: tuple[int, int, float],
    newton: Any,
) -> tuple[
    NDArray[np.float64], NDArray[np.float64], float, float, float, float, float
]:  # pragma: no cover  (compiled)
    """Computes the fields of ``Peaks``. If a pair has no peak, ``correlation`` is 0.

    Args:
        cross: (p, bins) cross-spectra of the pairs, units of the audio frame squared.
        weights: (p, bins) weights of the cross-spectra.
        energy: (n,) energies of the channels, units of the audio frame squared.
        arrivals: (n,) times of arrival to start from, relative to channel 0, samples.
        tables: Pairs of channels and their matrices, see ``PairTables``.
        sizes: Three numbers: first bin; length of the transform, samples; and effective
            length of the cut channels, samples. Their soft edges reduce the effective
            length.
        newton: Whether to refine the delays between samples by Newton's method.

    Returns:
        The seven fields of ``Peaks``, in their order.
    """
    pairs, to_delays, to_shares = tables
    first, length, cut_samples = sizes
    others = len(energy) - 1
    step = 2.0 * math.pi / length
    # The channels are cut at whole samples. Each remaining delay is a fraction of a
    # sample.
    whole = np.rint(arrivals)
    start = np.empty(len(pairs))
    for p in range(len(pairs)):
        i, j = pairs[p]
        start[p] = (arrivals[j] - whole[j]) - (arrivals[i] - whole[i])
    tau, plain, agreement, sums = _refine(
        cross, weights, first * step, step, start, newton
    )
    reconciled, covariance = np.empty(others + 1), np.empty((others, others))
    r = np.empty(len(pairs))
    for p in range(len(pairs)):
        i, j = pairs[p]
        tau[p] += whole[j] - whole[i]
        r[p] = plain[p] / max(math.sqrt(energy[i] * energy[j]), 1e-300)
    # Errors, if every pair has a peak.
    correlation, angular_frequency, noise_energy = 0.0, 0.0, 0.0
    moved, closure = _reconcile(tau, arrivals, pairs, to_delays, reconciled)
    if r.min() > 0.0 and sums[:, 0].min() > 0.0:
        padding = length / cut_samples
        variances = _arrival_variances(
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
