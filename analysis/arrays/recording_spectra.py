"""Computes short spectra of a recording, and the weight of each spectrum.

The recording is cut into short overlapping windows, the snapshots. The weight of a
snapshot at a frequency grows with its power relative to two levels. The first level is
the noise. The second level is the remaining echo of earlier snapshots in the room. The
onset of a sound therefore has the largest weight. The onset arrives directly from the
source, but the later sound also arrives from the walls.

A recording of short sounds has one snapshot per sound instead. A click or a chirp of a
few milliseconds ends before its first echo arrives, or soon after. A window around such
a sound contains the direct sound and few echoes, even if many echoes follow.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import fft
from scipy.ndimage import maximum_filter1d

WINDOW_S = 0.032
#: Least length of a window, as a multiple of the travel time of sound along the array.
TRAVELS = 6.0
# Least length of a recording: _LEAST_WINDOW_S in addition to a multiple of the travel
# time.
_LEAST_WINDOW_S, _LEAST_TRAVELS = 8e-4, 2.0
# _QUIET: quantile of the power that counts as the level of the quiet snapshots.
# _QUIET_TO_MEAN: ratio of the mean power of noise to the quantile _QUIET of its power.
_QUIET = 0.1
_QUIET_TO_MEAN = 1.5
# Least variation of the level in a recording with quiet snapshots, dB.
_LEAST_CONTRAST_DB = 6.0
#: Least power that counts, as a multiple of the noise power.
ABOVE_NOISE = 2.0
#: Assumed reverberation time of the room, s.
REVERBERATION_S = 0.5
# Share of the expected echo that is subtracted.
_ECHO_SHARE = 0.8

# Time from the start of a window to the onset, s, in addition to the travel time of
# sound along the array. The window rises over this time, and falls over the same time
# at its end.
_BEFORE_S = 0.003
#: Possible lengths of a window after the onset, s. The first is for clicks, the others
#: are for longer sounds.
AFTER_S = (0.014, 0.04, 0.11)

# An onset is a rise of the energy above two levels: the level for some time before it,
# and the level of the quiet parts of the recording.
# - _STEP_S: time step of the energy, s.
# - _QUIET_BEFORE_S: duration of the comparison before the onset, s.
# - _ATTACK: longest duration of the rise, steps.
# - _RISE_DB: least rise of an onset, dB.
# - _BEGUN_DB: rise at which the sound has begun, dB.
# - _QUIET_ENERGY: quantile of the energy that counts as the level of the quiet parts.
_STEP_S = 0.001
_QUIET_BEFORE_S = 0.05
_ATTACK = 15
_RISE_DB, _BEGUN_DB = 10.0, 5.0
_QUIET_ENERGY = 0.2

# _MOST: share of the energy of a short sound, echoes included, that arrives within
#   _SHORT_S of its onset. It is also the least share of short sounds in a recording of
#   short sounds.
# _SHORT_S: longest duration of a short sound, s.
# _LONGEST_S: longest time that counts as part of one sound, s.
_MOST, _SHORT_S = 0.9, 0.25
_LONGEST_S = 0.6

# Highest corner frequency of the filter, as a share of the sample rate.
_HIGHEST = 0.49


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
    levels: tuple[float, ...] | None = None
    """Levels of the n channels as recorded, in any unit. None: equal levels."""

    @property
    def seconds(self) -> float:
        """Duration of the recording, s."""
        return self.channels.shape[1] / self.sample_rate_hz

    @cached_property
    def window(self) -> NDArray[np.float32]:
        """(w,) window function of a snapshot."""
        from scipy.signal.windows import hann

        seconds = max(WINDOW_S, TRAVELS * self.travel_s)
        size = fft.next_fast_len(math.ceil(seconds * self.sample_rate_hz), real=True)
        # A short recording is a single snapshot.
        if self.least_samples <= self.channels.shape[1] < size:
            size = self.channels.shape[1]
        return hann(size, sym=False).astype(np.float32)

    @property
    def least_samples(self) -> int:
        """Least number of samples of a recording in which delays can be measured."""
        seconds = _LEAST_WINDOW_S + _LEAST_TRAVELS * self.travel_s
        return math.ceil(seconds * self.sample_rate_hz)

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
        """Computes the (n, k, f) spectra of k snapshots within the band.

        ``lags`` shifts each channel by a number of samples. A positive shift reads
        later samples.
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
        if not parts:
            return np.zeros((0, self.angular_frequency.size), dtype=np.float32)
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
        decay = np.float32(10.0 ** (-6.0 * hop_s / REVERBERATION_S))
        echo = np.zeros_like(power)
        for k in range(1, len(power)):
            echo[k] = decay * np.maximum(echo[k - 1], power[k - 1])
        above = 1.0 - np.minimum(ABOVE_NOISE * self.noise, power) / power
        direct = 1.0 - np.minimum(_ECHO_SHARE * echo, power) / power
        # Digital silence has the weight 0, even long after the last echo.
        return (above * direct * (self.power > tiny)).astype(np.float32)


@dataclass(frozen=True)
class OnsetSpectra(RecordingSpectra):
    """Spectra of a recording of short sounds. Each sound is one snapshot."""

    after_s: float = AFTER_S[0]
    """Length of a window after the onset, s."""

    @cached_property
    def window(self) -> NDArray[np.float32]:
        """(w,) window of a snapshot. It rises before the onset and falls at its end."""
        soft = round(_BEFORE_S * self.sample_rate_hz)
        flat = round(self.after_s * self.sample_rate_hz)
        rise = np.sin(0.5 * math.pi * (np.arange(soft) + 0.5) / soft) ** 2
        return np.concatenate((rise, np.ones(flat), rise[::-1])).astype(np.float32)

    @cached_property
    def energy(self) -> NDArray[np.float64]:
        """(k,) mean power of all channels within the band, in steps of 1 ms."""
        from scipy.signal import butter, sosfilt  # slow import, about 1 s

        step = round(_STEP_S * self.sample_rate_hz)
        # The filter is causal, so no part of a sound appears before its onset.
        high_hz = min(self.high_hz, _HIGHEST * self.sample_rate_hz)
        band = butter(
            2, (self.low_hz, high_hz), "band", fs=self.sample_rate_hz, output="sos"
        )
        heard = sosfilt(band, self.channels, axis=1)
        count = heard.shape[1] // step
        power = np.mean(heard[:, : count * step] ** 2, axis=0, dtype=np.float64)
        return power.reshape(count, step).mean(axis=1)

    @cached_property
    def onsets(self) -> NDArray[np.int64]:
        """(s,) numbers of the 1 ms steps at which sounds begin."""
        energy, before = self.energy, round(_QUIET_BEFORE_S / _STEP_S)
        if energy.size <= before:
            return np.zeros(0, dtype=np.int64)
        # Largest energy in the 50 ms before the possible attack.
        past = maximum_filter1d(energy, before, origin=before - 1 - before // 2)
        past = np.concatenate((np.full(_ATTACK, np.inf), past[:-_ATTACK]))
        past = np.maximum(past, np.quantile(energy, _QUIET_ENERGY))
        high = energy > 10.0 ** (_RISE_DB / 10.0) * past
        high[: before + _ATTACK] = False
        steps = np.flatnonzero(high)
        begun = steps[np.diff(steps, prepend=-before) >= before]
        # A sound with a slow attack begins before it reaches the threshold.
        for row, k in enumerate(begun):
            rising = energy[k - _ATTACK : k] > 10.0 ** (_BEGUN_DB / 10.0) * past[k]
            quiet = np.flatnonzero(~rising)
            begun[row] = k - _ATTACK + (quiet[-1] + 1 if quiet.size else 0)
        return begun

    @cached_property
    def starts(self) -> NDArray[np.int64]:
        """(s,) numbers of the first samples of the snapshots."""
        step = round(_STEP_S * self.sample_rate_hz)
        lead = self.travel_s * self.sample_rate_hz + self._soft
        first = self.onsets * step - round(lead)
        last = self.channels.shape[1] - self.window.size
        return first[(first >= 0) & (first <= last)]

    @property
    def are_most(self) -> bool:
        """Whether most of the energy in the recording belongs to short sounds."""
        energy = self.energy - np.quantile(self.energy, _QUIET_ENERGY)
        ends = np.append(self.onsets, energy.size)[1:]
        longest = round(_LONGEST_S / _STEP_S)
        short, whole = 0.0, float(np.maximum(energy, 0.0).sum())
        for first, last in zip(self.onsets, ends, strict=True):
            sound = np.maximum(energy[first : min(last, first + longest)], 0.0)
            come = np.cumsum(sound)
            if np.searchsorted(come, _MOST * come[-1]) * _STEP_S <= _SHORT_S:
                short += float(come[-1])
        return short > _MOST * whole > 0.0

    @property
    def _soft(self) -> float:
        return _BEFORE_S * self.sample_rate_hz

    @cached_property
    def noise_before(self) -> NDArray[np.float32]:
        """(s, f) power in a window that ends where the snapshot begins."""
        take = self.starts[:, np.newaxis] + np.arange(-self.window.size, 0)
        frames = self.channels[:, np.maximum(take, 0)] * self.window
        spectra = fft.rfft(frames, axis=-1)[..., self.bins]
        return np.mean(np.abs(spectra) ** 2, axis=0)

    @cached_property
    def weights(self) -> NDArray[np.float32]:
        """(s, f) weight of each snapshot and frequency, 0 to 1."""
        power = np.maximum(self.power, np.finfo(np.float32).tiny)
        kernel = np.full(5, 0.2, dtype=np.float32)
        noise = np.array(
            [np.convolve(row, kernel, "same") for row in self.noise_before]
        )
        above = 1.0 - np.minimum(ABOVE_NOISE * noise, power) / power
        return (above * (self.power > np.finfo(np.float32).tiny)).astype(np.float32)
