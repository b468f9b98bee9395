"""Short spectra of a recording, and how much each of them is worth.

A recording is cut into short overlapping windows, the snapshots. What a
snapshot holds at a frequency counts as far as it stands out of the noise, and
out of what a room still echoes from the snapshots before: the start of a sound
comes straight from its source, what follows comes from the walls as well.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import fft

WINDOW_S = 0.032
#: Windows are at least this many times as long as sound takes along the array.
TRAVELS = 6.0
# Quiet snapshots have at most this quantile of the power. In noise, the lowest
# tenth lies below the mean by about the second factor.
_QUIET = 0.1
_QUIET_TO_MEAN = 1.5
# A recording whose level varies by less holds no quiet snapshots, dB.
_LEAST_CONTRAST_DB = 6.0
#: What is below this much of the noise's power counts nothing.
ABOVE_NOISE = 2.0
# A room's echo: reverberation time, and the share of it that is taken away.
_REVERBERATION_S = 0.5
_ECHO_SHARE = 0.8


@dataclass(frozen=True)
class RecordingSpectra:
    """A recording of n channels, ready to be looked at in snapshots."""

    channels: NDArray[np.float32]
    """(n, samples), each of unit power."""
    sample_rate_hz: float
    low_hz: float
    high_hz: float
    travel_s: float
    """Longest time that sound takes from microphone to microphone, s."""

    @cached_property
    def window(self) -> NDArray[np.float32]:
        """(w,) shape of a snapshot."""
        from scipy.signal.windows import hann

        seconds = max(WINDOW_S, TRAVELS * self.travel_s)
        size = fft.next_fast_len(math.ceil(seconds * self.sample_rate_hz), real=True)
        return hann(size, sym=False).astype(np.float32)

    @property
    def hop(self) -> int:
        """Samples from one snapshot to the next."""
        return self.window.size // 2

    @cached_property
    def starts(self) -> NDArray[np.int64]:
        """(s,) first samples of the snapshots."""
        last = self.channels.shape[1] - self.window.size
        return np.arange(0, last + 1, self.hop)

    @cached_property
    def bins(self) -> slice:
        """Bins of the band."""
        period = self.window.size / self.sample_rate_hz
        first = max(1, math.ceil(self.low_hz * period))
        return slice(first, math.floor(self.high_hz * period) + 1)

    @cached_property
    def angular_frequency(self) -> NDArray[np.float64]:
        """(f,) of the bins, rad/s."""
        step = 2.0 * math.pi * self.sample_rate_hz / self.window.size
        return step * np.arange(self.bins.start, self.bins.stop)

    def spectra(
        self, snapshots: slice, lags: NDArray[np.int64] | None = None
    ) -> NDArray[np.complex64]:
        """Spectra of some snapshots within the band.

        Args:
            snapshots: Which ones.
            lags: (n,) samples by which each channel is read later.

        Returns:
            (n, k, f) channels, snapshots and bins, in the unit of the samples.
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
        """(s, f) mean over the channels."""
        parts = [
            np.mean(np.abs(self.spectra(slice(k, k + 256))) ** 2, axis=0)
            for k in range(0, self.starts.size, 256)
        ]
        return np.concatenate(parts)

    @cached_property
    def noise(self) -> NDArray[np.float32]:
        """(f,) power of the quiet snapshots; 0 where there are none.

        A sound that never stops is not taken for noise: whether it comes from
        one place is for the coherence to tell.
        """
        level = self.power.mean(axis=1)
        low, high = np.quantile(level, [_QUIET, 1.0 - _QUIET])
        if high < 10.0 ** (_LEAST_CONTRAST_DB / 10.0) * low:
            return np.zeros(self.power.shape[1], dtype=np.float32)
        noise = _QUIET_TO_MEAN * np.quantile(self.power, _QUIET, axis=0)
        return np.convolve(noise, np.full(5, 0.2), "same").astype(np.float32)

    @cached_property
    def weights(self) -> NDArray[np.float32]:
        """(s, f) what each snapshot is worth, 0 to 1."""
        tiny = np.finfo(np.float32).tiny
        power = np.maximum(self.power, tiny)
        hop_s = self.hop / self.sample_rate_hz
        decay = np.float32(10.0 ** (-6.0 * hop_s / _REVERBERATION_S))
        echo = np.zeros_like(power)
        for k in range(1, len(power)):
            echo[k] = decay * np.maximum(echo[k - 1], power[k - 1])
        above = 1.0 - np.minimum(ABOVE_NOISE * self.noise, power) / power
        direct = 1.0 - np.minimum(_ECHO_SHARE * echo, power) / power
        # Digital silence is worth nothing, however long ago its last echo was.
        return (above * direct * (self.power > tiny)).astype(np.float32)
