"""Newton's method for the peaks of weighted cross-correlations, from their spectra."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from systems.propagation import REORDER

__all__ = ["refine_peaks"]

# Largest number of steps, and the step at which it ends, samples.
_ITERATIONS = 10
_TOLERANCE = 1e-6


@njit(cache=True, fastmath=REORDER)
def _turned(cross, first, step, t, real, imaginary):  # pragma: no cover  (compiled)
    """Fills in the parts of a cross-spectrum (n,) times exp(j w t).

    The turns come from a few cosines by doubling: the rest is sums and products.
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


@njit(cache=True, fastmath=REORDER)
def _slope_and_curve(
    real, imaginary, weights, first, step
):  # pragma: no cover  (compiled)
    """Derivatives of a correlation: sums of -w W Im(z) and of w^2 W Re(z)."""
    slope, curve = 0.0, 0.0
    for k in range(real.size):
        w = first + k * step
        slope -= w * weights[k] * imaginary[k]
        curve += w * w * weights[k] * real[k]
    return slope, curve


@njit(cache=True, fastmath=REORDER)
def _sums(real, imaginary, weights, first, step):  # pragma: no cover  (compiled)
    """Sums of Re(z), W Re(z), W |z|, w^2 W^2 Re(z) and w^2 W^2."""
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
def refine_peaks(
    cross, weights, first, step, start, newton
):  # pragma: no cover  (compiled)
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
        sums[p] = curve, squares, noise
    return tau, plain, agreement, sums
