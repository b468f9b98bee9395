"""Computes whitened correlations of all pairs of channels, frame by frame."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from systems.delays.correlations import correlations_at_lags, parabola_vertex, whitening

# Number of frames to use. They are the loudest frames anywhere in the recording.
_FRAMES = 64

# Number of loudest frames that are also averaged separately. If sounds are short, these
# frames contain the sounds, and all other frames contain little more than echoes.
_LOUDEST = 16

# _FRAME_S: least length of a frame, s.
# _CROSSINGS: least length of a frame, as a multiple of the travel time of sound across
#   the array.
_FRAME_S = 0.05
_CROSSINGS = 12

# Longest delay to search, as a multiple of the longest possible delay. The search can
# thus find impossible delays.
_BEYOND = 3.0

# Number of points of the correlation per sample.
_DENSITY = 4


@dataclass(frozen=True)
class PairCorrelations:
    """Peaks of the correlations of p pairs in f frames, and levels of n channels."""

    pairs: NDArray[np.int64]
    """(p, 2) numbers i < j of the two channels of each pair."""
    lag_of_highest: NDArray[np.float64]
    """(f, p) delay t_j - t_i of the largest value of the correlation, samples."""
    lag_of_lowest: NDArray[np.float64]
    """(f, p) delay t_j - t_i of the smallest value of the correlation, samples."""
    pooled_highest: NDArray[np.float64]
    """(p,) largest value of the mean correlation over all frames."""
    pooled_lowest: NDArray[np.float64]
    """(p,) smallest value of the mean correlation over all frames."""
    shared: NDArray[np.float64]
    """(p,) largest magnitude of the mean correlation, as a multiple of its magnitude
    for independent noise. The mean is over all frames or over the loudest frames,
    whichever gives the larger value."""
    levels: NDArray[np.float64]
    """(f, n) root-mean-square value of each channel within the band."""
    level: NDArray[np.float64]
    """(n,) root-mean-square value of each channel over these frames."""
    noise: float
    """Approximate pooled peak value for independent noise."""


def correlate_pairs(
    samples: NDArray[np.float64],
    max_delay_s: float,
    sample_rate_hz: float,
    band_hz: tuple[float, float],
) -> PairCorrelations | None:
    """Computes the peaks of the correlations of all pairs in the loudest frames.

    The (n, samples) channels have no NaN. The search covers three times the delay
    ``max_delay_s``, so that it also finds impossible delays. The result is None if the
    recording is too short or silent.
    """
    count, total = samples.shape
    crossing = max_delay_s * sample_rate_hz
    gate = math.ceil(_BEYOND * crossing) + 2
    least = max(_FRAME_S * sample_rate_hz, _CROSSINGS * crossing)
    length = int(fft.next_fast_len(math.ceil(least), real=True))
    frames = total // length
    if frames == 0:
        return None
    # Views avoid copies, because recordings may be long.
    cut = [row[: frames * length].reshape(frames, length) for row in samples]
    energy = np.array([np.var(channel, axis=1) for channel in cut])
    mean = energy.mean(axis=1, keepdims=True)
    loudness = np.mean(energy / np.maximum(mean, 1e-300), axis=0)
    chosen = np.sort(np.argsort(-loudness)[:_FRAMES])
    loudest = np.argsort(-loudness[chosen])[:_LOUDEST]
    window = np.hanning(length)
    frames_of = np.array([channel[chosen] for channel in cut])
    spectra = fft.rfft(frames_of * window, 2 * length)
    f = fft.rfftfreq(2 * length, 1.0 / sample_rate_hz)
    outside = (f < band_hz[0]) | (f > band_hz[1])
    spectra[:, :, outside] = 0.0
    bins = np.count_nonzero(~outside) / 2.0
    power = np.sum(np.abs(spectra) ** 2, axis=2) / length
    if bins < 1 or not power.any():
        return None
    pairs = np.stack(np.triu_indices(count, 1), axis=1)
    values = [_correlation(spectra[i], spectra[j], gate) for i, j in pairs]
    one = math.sqrt(math.log(2.0 * gate + 1.0) / bins)
    shared = [
        max(
            np.abs(v[k].mean(axis=0)).max() * math.sqrt(len(v[k])) / one
            for k in (slice(None), loudest)
        )
        for v in values
    ]
    return PairCorrelations(
        pairs=pairs,
        lag_of_highest=np.stack([_vertex(v) for v in values], axis=1) - gate,
        lag_of_lowest=np.stack([_vertex(-v) for v in values], axis=1) - gate,
        pooled_highest=np.array([v.mean(axis=0).max() for v in values]),
        pooled_lowest=np.array([v.mean(axis=0).min() for v in values]),
        shared=np.array(shared),
        levels=np.sqrt(power / length).T,
        level=np.sqrt(power.mean(axis=1) / length),
        noise=one / math.sqrt(chosen.size),
    )


def _correlation(
    first: NDArray[np.complex128], second: NDArray[np.complex128], gate: int
) -> NDArray[np.float64]:
    """Returns the (f, lags) correlation of a pair for lags up to ``gate`` samples."""
    cross = (first.conj() * second).astype(np.complex64)
    cross = cross * whitening(cross)
    total = np.sum(np.abs(cross), axis=1, keepdims=True)
    grid = _DENSITY * 2 * (cross.shape[1] - 1)
    # The magnitudes of the bins add up to 1, so all values are between -1 and 1.
    band = slice(cross.shape[1])
    share = cross / np.maximum(total, 1e-30)
    return correlations_at_lags(share, band, grid, _DENSITY * gate) * (grid / 2.0)


def _vertex(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns the position of the largest value of each row, samples."""
    rows = np.arange(len(values))
    best = np.clip(values.argmax(axis=1), 1, values.shape[1] - 2)
    left, top, right = (values[rows, best + k] for k in (-1, 0, 1))
    return (best + parabola_vertex(left, top, right)) / _DENSITY
