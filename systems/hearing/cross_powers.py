"""Cross-power spectra that are gathered over many frames."""

from __future__ import annotations

from functools import cache
from itertools import combinations
from typing import NamedTuple

import numpy as np
import scipy.fft
from numpy.typing import NDArray

#: A bin is occupied where this share of the channels' power is the sound's,
_LEAST_SHARE = 0.25
#: and more than this share of the noise's: its cross power differs by about as much
#: from one second to the next.
_LEAST_OVER_NOISE = 0.3
#: Or, relative to the strongest bin, this share of its power.
_LEAST_POWER = 1e-4
#: Points of a correlation between two samples.
FINE = 8


class FrameSpectra(NamedTuple):
    """How frames become spectra: two of them after one another, by a Hann window."""

    channels: int
    samples: int
    """Of a frame."""
    rate_hz: float
    top_hz: float
    """Highest frequency that is kept."""

    @property
    def length(self) -> int:
        """Samples of a transform."""
        return 2 * self.samples

    @property
    def bins(self) -> int:
        """Number of frequencies from 0 on that are kept."""
        return int(self.top_hz / self.rate_hz * self.length) + 1

    @property
    def frequencies_hz(self) -> NDArray[np.float64]:
        """(bins,) Hz."""
        return np.arange(self.bins) * self.rate_hz / self.length

    @property
    def pairs(self) -> list[tuple[int, int]]:
        """Of channels, i < j."""
        return [*combinations(range(self.channels), 2)]


class CrossPowers(NamedTuple):
    """Sums over frames."""

    pairs: NDArray[np.complex128]
    """(pairs, bins) of X_i X_j*."""
    own: NDArray[np.float64]
    """(channels, bins) of each channel's power."""
    frames: float
    """How many."""


@cache
def _window(length: int) -> NDArray[np.float64]:
    return 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(length) / length)


def gather_frame(
    facts: FrameSpectra,
    sums: CrossPowers,
    before: NDArray[np.float64],
    now: NDArray[np.float64],
) -> CrossPowers:
    """Adds the spectra of a frame and the one before it.

    Args:
        facts: How frames become spectra.
        sums: So far.
        before: (channels, samples) of the frame before.
        now: (channels, samples).

    Returns:
        The new sums.
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
    """Cross powers of the sound alone, and where they are.

    Args:
        facts: How frames became spectra.
        sound: While it sounded; some frames.
        noise: Before it sounded, which is subtracted; none: nothing is.
        band_hz: Lowest and highest frequency that count, Hz.

    Returns:
        (pairs, bins) means, and (pairs, bins) whether a bin is occupied: by a good
        share of both channels' power, not far below the strongest, and above what
        noise leaves when it is subtracted.
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
    """Correlations of weighted cross powers.

    Args:
        facts: How frames became spectra.
        weighted: (pairs, bins).
        fine: Points a sample.

    Returns:
        (pairs, fine length) over the delay t_j - t_i, the delay 0 first, negative ones
        from the end.
    """
    count = fine * facts.length
    return scipy.fft.irfft(np.conj(weighted), count, axis=1) * count
