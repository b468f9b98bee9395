"""Refines the position of a source by maximum likelihood.

A sound of unknown waveform reaches microphone m at the time t_m with the gain a_m, in
white noise. Let X_m be the spectrum of channel m, and w_k the angular frequency of bin
k. With the best estimate of the waveform, the likelihood of a position increases with
sum_k |Y_k|^2 / sum_m a_m^2, where Y_k = sum_m a_m X_m(w_k) exp(j w_k t_m).

Newton's method maximizes this expression. Each step has two parts:

1. The slope and the curvature with respect to the times of arrival give a set of delays
   with a covariance.
2. The position that fits these delays (``systems.hearing.multilateration``) is the next
   position.

If there are only as many delays as unknowns, the result maximizes the likelihood over
all sets of delays. With more delays, it maximizes the likelihood over those sets that
belong to a position.

The gains are estimated as the principal component of the cross-spectra of the channels.
If the microphones are alike, the gains are proportional to 1/R_m, where R_m is the
distance of microphone m.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from systems.delays.overlap import EDGE_SAMPLES, cut_to_overlap
from systems.framework.compiling import njit
from systems.hearing.multilateration import locate_source
from systems.hearing.source_fix import SourceFix
from systems.sound.array_shape import ArrayShape

# Largest number of Newton steps.
_STEPS = 8
# Largest change of a delay in the last Newton step, samples.
_SETTLED = 1e-4

# Difference between a delay and the delay of the cut above which the channels are cut
# again, samples.
_RECUT = 0.02

# Least share of a frame that must remain after the channels are cut to their common
# section.
_LEAST_OVERLAP = 0.25


@njit(cache=True)
def _ranges(
    p_AM: NDArray[np.float64], p_AS: NDArray[np.float64]
) -> NDArray[np.float64]:  # pragma: no cover  (compiled)
    """Returns the (n,) distances of the microphones from a position, m."""
    ranges = np.empty(len(p_AM))
    for m in range(len(p_AM)):
        square = 0.0
        for k in range(p_AM.shape[1]):
            square += (p_AM[m, k] - p_AS[k]) ** 2
        ranges[m] = math.sqrt(square)
    return ranges


def arrival_delays(fix: SourceFix, shape: ArrayShape, c: float) -> NDArray[np.float64]:
    """Returns the delays between the microphones for sound from an estimated source.

    Args:
        fix: Estimated position relative to the array. Without a valid range, the sound
            is a plane wave from the estimated direction.
        shape: The n microphones.
        c: Speed of sound, m/s.

    Returns:
        (n - 1,) delays t_k - t_0, s. t_k is the time of arrival at channel k.
    """
    if fix.range_valid:
        ranges = _ranges(shape.p_AM, fix.p_AS)
    else:
        ranges = -shape.p_AM @ fix.p_AS
    return np.asarray((ranges[1:] - ranges[0]) / c)


def refine_source(
    frame: NDArray[np.float32],
    start: SourceFix,
    shape: ArrayShape,
    c: float,
    *,
    sample_rate_hz: float,
    band_hz: tuple[float, float],
) -> SourceFix | None:
    """Finds the most likely position of a source near a first estimate.

    Args:
        frame: (n, samples) channels, any unit.
        start: First estimate. The errors of its delays must be below half a period of
            the highest frequency of the sound.
        shape: The n microphones.
        c: Speed of sound, m/s.
        sample_rate_hz: Sample rate of the audio frame, Hz.
        band_hz: Lowest and highest frequency to use, Hz.

    Returns:
        The refined estimate, with errors that follow from signal and noise in the
        frame. None if the likelihood has no maximum nearby.
    """
    fix, cut_at = start, np.full(shape.count - 1, np.inf)
    for _ in range(_STEPS):
        delays = arrival_delays(fix, shape, c) * sample_rate_hz
        if np.abs(delays - cut_at).max() > _RECUT:
            cut = _cut(frame, delays)
            if cut is None:
                return None
            cut_at, whole = delays, np.rint(delays)
            spectra, first, step, padding = _spectra(cut, sample_rate_hz, band_hz)
        found = _newton_step(spectra, first, step, delays - whole)
        if found is None:
            return None
        move, covariance = found
        fix = locate_source(
            (delays + move) / sample_rate_hz,
            covariance * (padding / sample_rate_hz**2),
            shape,
            c,
        )
        if np.abs(move).max() < _SETTLED:
            break
    return fix


def _cut(
    frame: NDArray[np.float32], delays: NDArray[np.float64]
) -> NDArray[np.float32] | None:
    """Returns the (n, m) section that all channels share; None if it is too short."""
    arrivals = np.concatenate((np.zeros(1), delays))
    length = frame.shape[1] - np.ptp(np.rint(arrivals))
    if length < max(_LEAST_OVERLAP * frame.shape[1], 4 * EDGE_SAMPLES):
        return None
    # An offset would appear at the edges of all channels alike.
    return cut_to_overlap(frame - frame.mean(axis=1, keepdims=True), arrivals)


def _spectra(
    cut: NDArray[np.float32], sample_rate_hz: float, band_hz: tuple[float, float]
) -> tuple[NDArray[np.complex64], float, float, float]:
    """Computes the spectra of cut channels within the band.

    Returns:
        Four values: (n, bins) spectra; angular frequency w of the first bin, rad per
        sample; step of w from bin to bin, rad per sample; and padding. The padding is
        the number of bins over which the noise of one independent bin is spread.
    """
    length = int(fft.next_fast_len(cut.shape[1], real=True))
    first = max(1, math.ceil(band_hz[0] * length / sample_rate_hz))
    last = min(length // 2, math.floor(band_hz[1] * length / sample_rate_hz))
    spectra = fft.rfft(cut, length)[:, first : last + 1]
    # Sums of the squares and fourth powers of the window: each edge has means of 3/8
    # and 35/128.
    flat = cut.shape[1] - 2 * EDGE_SAMPLES
    squares, fourths = flat + 0.75 * EDGE_SAMPLES, flat + 35.0 / 64.0 * EDGE_SAMPLES
    step = 2.0 * math.pi / length
    return spectra, first * step, step, length * fourths / squares**2


@njit(cache=True)
def _pair_sums(
    spectra: NDArray[np.complex64], first: float, step: float, rest: NDArray[np.float64]
) -> tuple[
    NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], float
]:  # pragma: no cover  (compiled)
    """Sums the products of the channels over the bins, after removal of their delays.

    Args:
        spectra: (n, bins) spectra X_m of the channels.
        first: Angular frequency w of the first bin, rad per sample.
        step: Step of w from bin to bin, rad per sample.
        rest: (n,) delays to remove, samples.

    Returns:
        Four sums over the bins. With the products z = X_m X_j^* of the channels m and
        j, they are:

        - (n, n) sums of Re(z);
        - (n, n) sums of w Im(z);
        - (n, n) sums of w^2 Re(z);
        - sum of w^2.
    """
    n, bins = spectra.shape
    aligned = np.empty((bins, n), dtype=np.complex128)
    for m in range(n):
        turn = complex(math.cos(first * rest[m]), math.sin(first * rest[m]))
        advance = complex(math.cos(step * rest[m]), math.sin(step * rest[m]))
        for k in range(bins):
            aligned[k, m] = spectra[m, k] * turn
            turn *= advance
    power = np.zeros((n, n))
    slope = np.zeros((n, n))
    curve = np.zeros((n, n))
    squares = 0.0
    for m in range(n):
        for j in range(m + 1):
            w = first
            for k in range(bins):
                x, y = aligned[k, m], aligned[k, j]
                real = x.real * y.real + x.imag * y.imag
                power[m, j] += real
                slope[m, j] += w * (x.imag * y.real - x.real * y.imag)
                curve[m, j] += w * w * real
                w += step
            power[j, m] = power[m, j]
            slope[j, m] = -slope[m, j]
            curve[j, m] = curve[m, j]
    for k in range(bins):
        squares += (first + k * step) ** 2
    return power, slope, curve, squares


def _newton_step(
    spectra: NDArray[np.complex64],
    first: float,
    step: float,
    rest: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """Computes one Newton step of the delays.

    The gains of the channels are the principal eigenvector of the cross powers. The
    slope and the curvature of the likelihood give the step. The other eigenvalues give
    the noise, which determines the covariance.

    Returns:
        (n - 1,) change of the delays, samples, and (n - 1, n - 1) covariance of the
        delays, samples^2. None if there is no maximum.
    """
    n, bins = spectra.shape
    power, slope, curve, squares = _pair_sums(
        spectra, first, step, np.concatenate((np.zeros(1), rest))
    )
    if not np.trace(power) > 0.0:
        return None
    values, vectors = np.linalg.eigh(power)
    gains = vectors[:, -1]  # of unit length
    weights = np.outer(gains, gains)
    information = -2.0 * weights * curve
    np.fill_diagonal(information, 0.0)
    information -= np.diag(information.sum(axis=1))
    gradient = -2.0 * (weights * slope).sum(axis=1)[1:]
    try:
        inverse = np.linalg.inv(np.linalg.cholesky(information[1:, 1:]))
    except np.linalg.LinAlgError:
        return None
    inverse = inverse.T @ inverse
    noise = float(np.sum(values[:-1])) / (bins * (n - 1))
    off = ~np.eye(n, dtype=bool)
    signal = float(np.sum((weights * curve)[off]) / np.sum(weights[off] ** 2))
    # The noise of one channel is multiplied by the sound and the noise of the others.
    excess = 1.0 + noise * squares / signal if signal > 0.0 else math.inf
    return inverse @ gradient, inverse * (noise * excess)
