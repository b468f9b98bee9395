"""Separates the sounds of a recording from its steady noise.

The recording is divided into cells of time and frequency. The quiet cells of a
frequency show the level of its noise. The cells well above this level belong to sounds.
They also show in which band the sounds are.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import fft
from scipy.ndimage import maximum_filter, uniform_filter

# Length of a cell, samples. Sounds of animals last the longer, the lower they are, and
# recorders have rates in proportion to the frequencies. A cell lasts 11 ms at 48 kHz
# and 1.3 ms at 384 kHz. Cells overlap by half.
_CELL = 512

# The noise of a frequency is the quantile _QUIET of its powers. For noise alone, the
# power is exponentially distributed.
_QUIET = 0.3
_QUIET_TO_MEAN = -1.0 / math.log(1.0 - _QUIET)

# Least power of a sound, as a multiple of the noise. It applies to the mean of 3 x 3
# cells. Noise exceeds it in fewer than one of 10^4 cells.
_ABOVE = 3.5

# Share of the excess that is outside the band of the sounds, at each end. In a cell,
# an excess above _MOST does not count.
_EDGE, _MOST = 0.01, 101.0

# Number of cells that are processed at once.
_BLOCK = 4096


class StandingSound(NamedTuple):
    """The sounds of one channel without the noise."""

    samples: NDArray[np.float32]
    """(samples,) sound; 0 where nothing stands above the noise."""
    excess: NDArray[np.float32]
    """(k,) power of the sound in steps of ``step`` samples, as a multiple of the noise
    in the same cells."""
    of_bins: NDArray[np.float64]
    """(f,) excess at each frequency. A cell counts at most 100, so that a single loud
    frequency does not count more than the other sounds."""

    @property
    def step(self) -> int:
        """Samples per step of ``excess``."""
        return _CELL // 2


def standing_sound(
    channel: NDArray[np.float32], sample_rate_hz: float, band_hz: tuple[float, float]
) -> StandingSound:
    """Keeps the cells of a channel in which a sound stands above the noise.

    A sound counts as noise if it fills more than 70 % of the time at a frequency.
    """
    hop = _CELL // 2
    # The square roots of two overlapping Hann windows multiply to windows of sum 1.
    window = np.sqrt(np.hanning(_CELL + 1)[:-1]).astype(np.float32)
    count = -(-channel.size // hop) + 1
    padded = np.zeros((count + 1) * hop, dtype=np.float32)
    padded[hop : hop + channel.size] = channel
    f = fft.rfftfreq(_CELL, 1.0 / sample_rate_hz)
    inside = (f >= band_hz[0]) & (f <= band_hz[1])
    frames = np.lib.stride_tricks.sliding_window_view(padded, _CELL)[::hop]
    power = np.empty((count, int(inside.sum())), dtype=np.float32)
    for k in range(0, count, _BLOCK):
        part = fft.rfft(frames[k : k + _BLOCK] * window, axis=1)[:, inside]
        power[k : k + _BLOCK] = np.abs(part) ** 2
    heard = power[power.any(axis=1)]
    noise = _QUIET_TO_MEAN * np.quantile(heard, _QUIET, axis=0) if len(heard) else 0.0
    noise = np.maximum(noise, 1e-6 * float(power.mean()) + np.finfo(np.float32).tiny)
    ratio = power / noise
    # The cells beside a loud cell contain the edges of its sound.
    loud = uniform_filter(ratio, 3, mode="constant") > _ABOVE
    sounding = maximum_filter(loud, 3)
    out = np.zeros_like(padded)
    for k in range(0, count, _BLOCK):
        part = fft.rfft(frames[k : k + _BLOCK] * window, axis=1)
        part[:, ~inside] = 0.0
        part[:, inside] *= sounding[k : k + _BLOCK]
        block = fft.irfft(part, _CELL, axis=1) * window
        for row, frame in enumerate(block, start=k):
            if sounding[row].any():
                out[row * hop : row * hop + _CELL] += frame
    of_bins = np.zeros(f.size)
    of_bins[inside] = np.where(loud, np.clip(ratio, 1.0, _MOST) - 1.0, 0.0).sum(axis=0)
    excess = np.where(loud, np.maximum(ratio - 1.0, 0.0), 0.0).sum(axis=1)
    return StandingSound(out[hop : hop + channel.size], excess, of_bins)


def sounding_band(
    sound: StandingSound, sample_rate_hz: float
) -> tuple[float, float] | None:
    """Returns the band that contains nearly all sound, Hz.

    The result is None if there is no sound.
    """
    cells = np.cumsum(sound.of_bins)
    if not cells[-1]:
        return None
    low, high = np.searchsorted(cells, np.array([_EDGE, 1.0 - _EDGE]) * cells[-1])
    step = sample_rate_hz / _CELL
    return max(0.0, (low - 1) * step), (high + 1) * step
