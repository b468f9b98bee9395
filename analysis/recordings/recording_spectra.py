"""Computes short spectra of a recording, and the weight of each spectrum.

The recording is cut into short overlapping windows, the snapshots. The weight of a
snapshot at a frequency grows with its power relative to two levels. The first level is
the noise. The second level is the remaining echo of earlier snapshots in the room. The
onset of a sound therefore has the largest weight. The onset arrives directly from the
source, but the later sound also arrives from the walls.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import fft

WINDOW_S = 0.032
#: Least length of a window, as a multiple of the travel time of sound along the array.
TRAVELS = 6.0
# _QUIET: quantile of the power that counts as the level of the quiet snapshots.
# _QUIET_TO_MEAN: ratio of the mean power of noise to the quantile _QUIET of its power.
_QUIET = 0.1
_QUIET_TO_MEAN = 1.5
# Least variation of the level in a recording with quiet snapshots, dB.
_LEAST_CONTRAST_DB = 6.0
#: Least power that counts, as a multiple of the noise power.
ABOVE_NOISE = 2.0
# _REVERBERATION_S: assumed reverberation time of the room, s.
# _ECHO_SHARE: share of the expected echo that is subtracted.
_REVERBERATION_S = 0.5
_ECHO_SHARE = 0.8


@dataclass(frozen=True)
class RecordingSpectra:
    """A recording of n channels, divided into snapshots.

    A snapshot is a short window of the recording.
    """

    channels: NDArray[np.float32]
    """(n, samples) samples; the mean power of each channel is 1."""
    sample_rate_hz: float
    low_hz: float
    high_hz: float
    travel_s: float
    """Longest travel time of sound between two microphones, s."""

    @cached_property
    def window(self) -> NDArray[np.float32]:
        """(w,) window function of a snapshot."""
        from scipy.signal.windows import hann

        seconds = max(WINDOW_S, TRAVELS * self.travel_s)
        size = fft.next_fast_len(math.ceil(seconds * self.sample_rate_hz), real=True)
        return hann(size, sym=False).astype(np.float32)

    @property
    def hop(self) -> int:
        """Number of samples from one snapshot to the next."""
        return self.window.size // 2

    @cached_property
    def starts(self) -> NDArray[np.int64]:
        """(s,) numbers of the first samples of the snapshots."""
        last = self.channels.shape[1] - self.window.size
        return np.arange(0, last + 1, self.hop)

    @cached_property
    def bins(self) -> slice:
        """Frequency bins within the band."""
        period = self.window.size / self.sample_rate_hz
        first = max(1, math.ceil(self.low_hz * period))
        return slice(first, math.floor(self.high_hz * period) + 1)

    @cached_property
    def angular_frequency(self) -> NDArray[np.float64]:
        """(f,) angular frequencies of the bins, rad/s."""
        step = 2.0 * math.pi * self.sample_rate_hz / self.window.size
        return step * np.arange(self.bins.start, self.bins.stop)

    def spectra(
        self, snapshots: slice, lags: NDArray[np.int64] | None = None
    ) -> NDArray[np.complex64]:
        """Computes the spectra of some snapshots within the band.

        Args:
            snapshots: Snapshots to use.
            lags: (n,) shift of each channel, samples. A positive shift reads later
                samples. None: no shifts.

        Returns:
            (n, k, f) spectra of n channels, k snapshots and f bins, in the unit of the
            samples.
        """
        size = self.window.size
        if lags is None:
            lags = np.zeros(len(self.channels), dtype=np.int64)
        take = self.starts[snapshots, np.newaxis] + np.arange(size)
        ceiling = self.channels.shape[1] - 1
        frames = np.stack(
            [
                row[np.clip(take + lag, 0, ceiling)]
                for row, lag in zip(self.channels, lags, strict=True)
            ]
        )
        return fft.rfft(frames * self.window, axis=-1)[..., self.bins]

    @cached_property
    def power(self) -> NDArray[np.float32]:
        """(s, f) power of each snapshot and bin, averaged over the channels."""
        parts = [
            np.mean(np.abs(self.spectra(slice(k, k + 256))) ** 2, axis=0)
            for k in range(0, self.starts.size, 256)
        ]
        return np.concatenate(parts)

    @cached_property
    def noise(self) -> NDArray[np.float32]:
        """(f,) power of the quiet snapshots. It is 0 if there are no quiet snapshots.

        A continuous sound does not count as noise. Its coherence later shows whether it
        comes from one position.
        """
        level = self.power.mean(axis=1)
        low, high = np.quantile(level, [_QUIET, 1.0 - _QUIET])
        if high < 10.0 ** (_LEAST_CONTRAST_DB / 10.0) * low:
            return np.zeros(self.power.shape[1], dtype=np.float32)
        noise = _QUIET_TO_MEAN * np.quantile(self.power, _QUIET, axis=0)
        return np.convolve(noise, np.full(5, 0.2), "same").astype(np.float32)

    @cached_property
    def weights(self) -> NDArray[np.float32]:
        """(s, f) weight of each snapshot and frequency, 0 to 1."""
        tiny = np.finfo(np.float32).tiny
        power = np.maximum(self.power, tiny)
        hop_s = self.hop / self.sample_rate_hz
        decay = np.float32(10.0 ** (-6.0 * hop_s / _REVERBERATION_S))
        echo = np.zeros_like(power)
        for k in range(1, len(power)):
            echo[k] = decay * np.maximum(echo[k - 1], power[k - 1])
        above = 1.0 - np.minimum(ABOVE_NOISE * self.noise, power) / power
        direct = 1.0 - np.minimum(_ECHO_SHARE * echo, power) / power
        # Digital silence has the weight 0, even long after the last echo.
        return (above * direct * (self.power > tiny)).astype(np.float32)
