"""Computes cross-power spectra of channels, summed over many frames."""

from __future__ import annotations

from functools import cache
from itertools import combinations
from typing import NamedTuple

import numpy as np
import scipy.fft
from numpy.typing import NDArray

#: A bin is occupied by sound if its cross power exceeds three limits. The first limit
#: is this share of the power of the two channels.
_LEAST_SHARE = 0.25
#: The second limit is this share of the power of the noise. The cross power of noise
#: changes by about as much from one second to the next.
_LEAST_OVER_NOISE = 0.3
#: The third limit is this share of the cross power of the strongest bin.
_LEAST_POWER = 1e-4
#: Number of correlation values per sample.
FINE = 8


class FrameSpectra(NamedTuple):
    """Sizes of the spectra of two successive frames, joined under a Hann window."""

    channels: int
    samples: int
    """Samples per channel of a frame."""
    rate_hz: float
    top_hz: float
    """Highest frequency that is kept."""

    @property
    def length(self) -> int:
        """Number of samples of a transform."""
        return 2 * self.samples

    @property
    def bins(self) -> int:
        """Number of frequencies that are kept, from 0 on."""
        return int(self.top_hz / self.rate_hz * self.length) + 1

    @property
    def frequencies_hz(self) -> NDArray[np.float64]:
        """(bins,) frequencies, Hz."""
        return np.arange(self.bins) * self.rate_hz / self.length

    @property
    def pairs(self) -> list[tuple[int, int]]:
        """All pairs of channels i < j."""
        return [*combinations(range(self.channels), 2)]


class CrossPowers(NamedTuple):
    """Sums over frames."""

    pairs: NDArray[np.complex128]
    """(pairs, bins) sums of X_i X_j*."""
    own: NDArray[np.float64]
    """(channels, bins) sums of the power of each channel."""
    frames: float
    """Number of frames."""


def no_powers(facts: FrameSpectra) -> CrossPowers:
    """Returns the sums before the first frame."""
    pairs = np.zeros((len(facts.pairs), facts.bins), dtype=np.complex128)
    return CrossPowers(pairs, np.zeros((facts.channels, facts.bins)), 0.0)


@cache
def _window(length: int) -> NDArray[np.float64]:
    return 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(length) / length)


def gather_frame(
    facts: FrameSpectra,
    sums: CrossPowers,
    before: NDArray[np.float64],
    now: NDArray[np.float64],
) -> CrossPowers:
    """Joins two successive frames, and adds their powers and cross powers to the sums.

    ``before`` and ``now`` are the previous and the present frame, (channels, samples).
    """
    joined = np.concatenate((before, now), axis=1)
    joined = (joined - joined.mean(axis=1, keepdims=True)) * _window(facts.length)
    spectra = scipy.fft.rfft(joined, axis=1)[:, : facts.bins]
    first, second = np.array(facts.pairs).T
    return CrossPowers(
        sums.pairs + spectra[first] * np.conj(spectra[second]),
        sums.own + np.abs(spectra) ** 2,
        sums.frames + 1.0,
    )


def signal_powers(
    facts: FrameSpectra,
    sound: CrossPowers,
    noise: CrossPowers | None,
    band_hz: tuple[float, float],
) -> tuple[NDArray[np.complex128], NDArray[np.bool_]]:
    """Computes the cross powers of the sound alone, and which bins the sound occupies.

    The sound occupies a bin of a pair of channels if the cross power exceeds three
    limits. Each limit is a fixed share of one of these values: the power of the sound
    in both channels, the power of the noise, or the cross power of the strongest bin.

    Args:
        facts: Sizes of audio frames and spectra.
        sound: Sums of at least one frame while the source sounded.
        noise: Sums from before the sound, which are subtracted. None: nothing is
            subtracted.
        band_hz: Lowest and highest frequency to use, Hz.

    Returns:
        Two (pairs, bins) arrays: the mean cross powers; and Boolean values that are
        true in occupied bins.
    """
    mean, own = sound.pairs / sound.frames, sound.own / sound.frames
    steady = np.zeros_like(own)
    if noise is not None and noise.frames > 0.0:
        mean = mean - noise.pairs / noise.frames
        steady = noise.own / noise.frames
    first, second = np.array(facts.pairs).T
    own = np.maximum(own - steady, 0.0)
    both = np.sqrt(own[first] * own[second])
    left = _LEAST_OVER_NOISE * np.sqrt(steady[first] * steady[second])
    size = np.abs(mean)
    f = facts.frequencies_hz
    inside = (f >= band_hz[0]) & (f <= band_hz[1])
    strongest = np.max(np.where(inside, size, 0.0), axis=1, keepdims=True)
    least = np.maximum(_LEAST_SHARE * both, left)
    occupied = inside & (size > least) & (size > _LEAST_POWER * strongest)
    return mean, occupied


def cross_correlations(
    facts: FrameSpectra, weighted: NDArray[np.complex128], fine: int = FINE
) -> NDArray[np.float64]:
    """Computes the cross-correlations of channels from weighted cross powers.

    Args:
        facts: Sizes of audio frames and spectra.
        weighted: (pairs, bins) weighted cross powers.
        fine: Number of correlation values per sample.

    Returns:
        (pairs, fine * length) correlations over the delay t_j - t_i of each pair (i,
        j). Delay 0 is first, and negative delays are at the end.
    """
    count = fine * facts.length
    return scipy.fft.irfft(np.conj(weighted), count, axis=1) * count
