"""Tells copied channels from channels that are equal because of the geometry.

Two microphones at equal distances from a source record equal samples, but only their
noise makes them different. In a simulation without noise, they look like copies. Such
channels are no fault in three conditions:

- The recording has no noise.
- The delays of all channels are those of a wave front.
- All other pairs of microphones that are symmetrical to the same plane are equal too.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from analysis.arrays.wave_fronts import wave_front_misfits
from systems.delays.copied_channels import copied_pairs

# Largest misfit of the delays of a wave front: the sum of a share of a sample, and of a
# share of the travel time along the array.
_MISFIT_SAMPLES, _MISFIT_SHARE = 0.25, 0.05

# A recording has no noise in either of two cases:
# - All channels are silent, by _SILENT times their level, for _SILENCE samples.
# - A filter of _TAPS samples turns one channel into another, except for the share
#   _DIFFERENT of its power. Noise and reverberation have a larger share.
_SILENCE, _SILENT = 16, 1e-6
_TAPS, _DIFFERENT = 129, 3e-5

# Largest deviation of two microphones from symmetry, as a share of their distance.
_ALIKE = 1e-3

# Powers at equal distances from a source differ by less than the share _LOUDER. The
# powers of one signal in all channels differ by less than _SAME.
_LOUDER, _SAME = 0.02, 1e-5

# Longest section of a recording that is examined, s.
_SECTION_S = 0.25
# Steps of a delay in a sample.
_FINER = 16

_Pair = tuple[int, int]


def copied_microphones(
    samples: NDArray[np.float64],
    sample_rate_hz: float,
    p_AM: NDArray[np.float64],
    c: float,
) -> list[_Pair]:
    """Finds the pairs of channels that repeat each other, and should not.

    Args:
        samples: (n, samples) channels that are not silent, without NaN.
        sample_rate_hz: Sample rate, Hz.
        p_AM: (n, 2) or (n, 3) positions of the microphones of these channels, m.
        c: Speed of sound, m/s.

    Returns:
        Channel numbers (i, j) of each pair, counted from 0, with i < j.
    """
    pairs = copied_pairs(samples, sample_rate_hz)
    if not pairs:
        return []
    loud = _loudest(samples, round(_SECTION_S * sample_rate_hz))
    later = _delays(loud)
    lags = later / sample_rate_hz
    aperture_s = float(np.linalg.norm(p_AM[:, np.newaxis] - p_AM, axis=2).max()) / c
    limit = _MISFIT_SAMPLES / sample_rate_hz + _MISFIT_SHARE * aperture_s
    fits = np.abs(wave_front_misfits(lags[np.newaxis], p_AM, c)).max() < limit
    # One signal in all channels is more often a copy than a source straight ahead.
    mono = not later.any() and _louder(loud) < _SAME
    if mono or not fits or not _has_no_noise(samples, loud, pairs):
        return pairs
    arrivals = np.concatenate(([0.0], later))
    at_once = {p for p in pairs if abs(arrivals[p[1]] - arrivals[p[0]]) < 0.5}
    return [p for p in pairs if p in at_once and not _symmetrical(p, loud, p_AM, pairs)]


def _louder(block: NDArray[np.float64]) -> float:
    """Returns by which share of its power the loudest channel exceeds the faintest."""
    powers = [float(np.var(channel)) for channel in block]
    return 1.0 - min(powers) / max(powers)


def _loudest(samples: NDArray[np.float64], size: int) -> NDArray[np.float64]:
    size = min(size, samples.shape[1])
    count = samples.shape[1] // size
    power = np.square(samples[:, : count * size]).sum(axis=0).reshape(count, size)
    first = size * int(power.sum(axis=1).argmax())
    return samples[:, first : first + size]


def _delays(block: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns the (n - 1,) delays of channels 1 ... n - 1 after channel 0, samples."""
    size = int(fft.next_fast_len(2 * block.shape[1], real=True))
    centered = block - block.mean(axis=1, keepdims=True)
    spectra = fft.rfft(centered * np.hanning(block.shape[1]), size)
    cross = spectra[0].conj() * spectra[1:]
    values = fft.irfft(cross, _FINER * size)
    later = values.argmax(axis=1).astype(np.float64)
    later[later > _FINER * size / 2] -= _FINER * size
    return np.asarray(later / _FINER)


def _has_no_noise(
    samples: NDArray[np.float64], loud: NDArray[np.float64], pairs: list[_Pair]
) -> bool:
    silent = np.abs(samples).max(axis=0) < _SILENT * samples.std()
    runs = np.convolve(silent, np.ones(_SILENCE), "valid")
    if runs.size and runs.max() == _SILENCE:
        return True
    others = [p for p in combinations(range(len(loud)), 2) if p not in pairs]
    return not others or _difference(*loud[list(others[0])]) < _DIFFERENT


def _difference(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    """Returns the share of a channel that no short filter makes of another channel."""
    half = _TAPS // 2
    if one.size < 4 * _TAPS:
        return 1.0
    rows = np.lib.stride_tricks.sliding_window_view(one, _TAPS)
    wanted = other[half : half + len(rows)]
    taps = np.linalg.lstsq(rows, wanted, rcond=1e-6)[0]
    return float(np.var(wanted - rows @ taps)) / max(float(np.var(wanted)), 1e-300)


def _symmetrical(
    pair: _Pair,
    block: NDArray[np.float64],
    p_AM: NDArray[np.float64],
    pairs: list[_Pair],
) -> bool:
    """Returns whether a source that is as far from both microphones explains a pair.

    The source is then in their plane of symmetry, and all other pairs with the same
    plane of symmetry must be equal, too.
    """
    i, j = pair
    if _louder(block[[i, j]]) > _LOUDER:
        return False
    normal = p_AM[j] - p_AM[i]
    middle = 0.5 * (p_AM[i] + p_AM[j])
    distance = (p_AM - middle) @ normal / (normal @ normal)
    mirrored = p_AM - 2.0 * np.outer(distance, normal)
    apart = np.linalg.norm(p_AM[:, np.newaxis] - mirrored, axis=2)
    alike = np.argwhere(apart < _ALIKE * np.linalg.norm(normal))
    return all((int(a), int(b)) in pairs for a, b in alike if a < b)
