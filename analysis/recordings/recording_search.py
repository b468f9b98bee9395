"""From where a recording sounds, stretch by stretch."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from analysis.arrays.steered_response import (
    LAG_DENSITY,
    SearchGrid,
    centroid_delays,
    steered_response,
)
from analysis.recordings.aligned_delays import AlignedDelays, fit_aligned_delays
from analysis.recordings.recording_spectra import RecordingSpectra
from systems.delays.correlations import correlations_at_lags
from systems.delays.delay_sets import consistent_lags
from systems.sound.array_shape import ArrayShape

# Least mean weight of a stretch's snapshots: the rest is silence or echo.
_LEAST_WEIGHT = 0.02
# A response counts above that of a diffuse field by this many deviations of
# what independent noise would give, and by this share of what direct sound
# alone would: no real noise comes from all around quite alike.
_DEVIATIONS = 5.0
_LEAST_DIRECT = 0.1
# To choose among the peaks of a stretch its neighbours help: how many on either
# side, and by which share.
_NEIGHBOURS, _HELP = 4, 0.5
# Sets of lags that are looked at more closely for a sound that stands alone, or where
# microphones may be off by more than this share of the shortest period. Those that
# agree less than the best one by this factor are side lobes, or of echoes alone.
_CANDIDATES, _MISPLACED, _LEAST_AGREEMENT = 8, 0.5, 0.75
# Sound that has come straight is the earlier, though it may agree a little less: delays
# are alike within the one time, and earlier beyond the other, s.
_ALIKE_S, _EARLIER_S = 1e-4, 4e-4


@dataclass(frozen=True)
class Sighting(AlignedDelays):
    """A stretch of the recording in which one place stands out.

    Its delays are whole, not what an alignment leaves; its coherence is the share of
    the sound that comes straight from the source.
    """

    t_s: float
    """Middle of the stretch, s."""


@dataclass(frozen=True)
class RecordingSearch:
    """A recording and the array that made it."""

    recording: RecordingSpectra
    shape: ArrayShape
    c: float
    snapshots: int
    """Of a stretch; stretches overlap by half, unless each is one snapshot."""
    slack_s: float = 0.0
    """By how much delays may be longer than the stated places allow, s."""
    has_place: Callable[[AlignedDelays], bool] = field(default=lambda _: True)
    """Whether delays are of some place; asked where there is a choice."""

    @cached_property
    def stretches(self) -> list[slice]:
        """Snapshots of each stretch."""
        count = len(self.recording.starts)
        size = min(self.snapshots, count)
        firsts = range(0, count - size + 1, max(1, size // 2))
        return [slice(k, k + size) for k in firsts]

    @property
    def stretch_s(self) -> float:
        """How long a stretch is, s."""
        count = self.stretches[0].stop
        samples = self.recording.window.size + (count - 1) * self.recording.hop
        return samples / self.recording.sample_rate_hz

    @cached_property
    def grid(self) -> SearchGrid:
        """Places to search."""
        return SearchGrid.of(
            self.shape, self.c, self.recording.high_hz, self._length / self._window_s
        )

    @property
    def _window_s(self) -> float:
        return self.recording.window.size / self.recording.sample_rate_hz

    @cached_property
    def _length(self) -> int:
        """Samples of a correlation in a whole window."""
        least = LAG_DENSITY * self.recording.high_hz * self._window_s
        return int(fft.next_fast_len(math.ceil(least), real=True))

    def _correlations(
        self, cross: NDArray[np.complex64], slack: int = 0
    ) -> NDArray[np.float32]:
        """(p, 2 m + 1) of the pairs' cross-spectra (p, f), which add up to 1."""
        m = self.grid.max_lag + slack
        values = correlations_at_lags(cross, self.recording.bins, self._length, m)
        return values * np.float32(0.5 * self._length)

    def _responses(self, cross: NDArray[np.complex64]) -> NDArray[np.float32]:
        """(g,) of the pairs' cross-spectra (p, f), which add up to 1."""
        return steered_response(self._correlations(cross), self.grid)

    @cached_property
    def diffuse_response(self) -> NDArray[np.float32]:
        """(g,) response to sound that comes from all around alike."""
        weights = self.recording.weights.mean(axis=0, dtype=np.float64)
        phase = np.outer(self.shape.distances_m, self.recording.angular_frequency)
        share = weights / max(weights.sum(), 1e-30)
        cross = np.sinc(phase / (math.pi * self.c)) * share
        return self._responses(cross.astype(np.complex64))

    def mean_response(self) -> float:
        """Greatest response of a stretch, on average: how well all pairs agree."""
        weights = [float(self.recording.weights[s].mean()) for s in self.stretches]
        best = [
            float(self._stretch_response(s, w).max())
            for s, w in zip(self.stretches, weights, strict=True)
        ]
        return float(np.average(best, weights=np.array(weights) + 1e-30))

    def sightings(self) -> Iterator[Sighting]:
        """Stretches with a source, in order of time."""
        held: deque[tuple[slice, float, NDArray[np.float32]]] = deque()
        near = np.zeros(len(self.grid.lags))
        weight = 0.0
        queue = iter(self.stretches)
        middle = 0
        for k in range(len(self.stretches) + _NEIGHBOURS):
            new = next(queue, None)
            if new is not None:
                value = float(self.recording.weights[new].mean())
                response = self._stretch_response(new, value)
                held.append((new, value, response))
                near += value * response
                weight += value
            if k < _NEIGHBOURS:
                continue
            stretch, value, response = held[middle]
            found = self._sighting(stretch, value, response, near / max(weight, 1e-30))
            if found is not None:
                yield found
            middle += 1
            if middle > _NEIGHBOURS:
                _, value, response = held.popleft()
                near -= value * response
                weight -= value
                middle -= 1

    def _stretch_response(self, stretch: slice, weight: float) -> NDArray[np.float32]:
        if weight < _LEAST_WEIGHT:
            return np.zeros(len(self.grid.lags), dtype=np.float32)
        cross = self._cross(stretch)
        return self._responses(cross / self.recording.weights[stretch].sum())

    def _cross(self, stretch: slice) -> NDArray[np.complex64]:
        """(p, f) whitened cross-spectra of the pairs, weighted."""
        weights = self.recording.weights[stretch]
        spectra = self.recording.spectra(stretch)
        power = np.mean(np.abs(spectra) ** 2, axis=0)
        spectra *= np.sqrt(weights / np.maximum(power, np.finfo(np.float32).tiny))
        first, second = self.shape.pairs.T
        cross = np.empty((len(first), spectra.shape[2]), dtype=np.complex64)
        for p, (i, j) in enumerate(zip(first, second, strict=True)):
            cross[p] = np.sum(spectra[i].conj() * spectra[j], axis=0)
        return cross

    def _sighting(
        self,
        stretch: slice,
        weight: float,
        response: NDArray[np.float32],
        near: NDArray[np.float64],
    ) -> Sighting | None:
        if weight < _LEAST_WEIGHT:
            return None
        single = self.snapshots == 1
        best = int(np.argmax(response if single else response + _HELP * near))
        if response[best] < self._threshold(best, stretch):
            return None
        misplaced = self.slack_s * self.recording.high_hz > _MISPLACED
        look = self._consistent if single or misplaced else self._delays
        fit = look(best, stretch)
        if fit is None:
            return None
        recording = self.recording
        first, last = recording.starts[[stretch.start, stretch.stop - 1]]
        ends = float(first + last + recording.window.size)
        return Sighting(**vars(fit), t_s=ends / (2.0 * recording.sample_rate_hz))

    def _consistent(self, place: int, stretch: slice) -> AlignedDelays | None:
        """The delays on which all channels agree best, of those that have a place.

        In a short window an echo at one microphone may pass for the sound: a wrong
        place of the grid then has the greatest response, though most pairs alone agree
        on it. Where microphones stand elsewhere than stated, no place of the grid may
        be near enough to find the peak and not its side lobe.
        """
        weight = float(self.recording.weights[stretch].sum())
        rate = self._length / self._window_s
        slack = math.ceil(self.slack_s * rate)
        reach = np.ceil(self.shape.distances_m / self.c * rate).astype(np.int64)
        sets = consistent_lags(
            self._correlations(self._cross(stretch) / weight, slack),
            self.shape.pairs,
            reach + slack,
            _CANDIDATES,
        )
        tried = [self._delays_at(lags / rate, stretch) for lags in sets]
        tried.append(self._delays(place, stretch))
        found = sorted((fit for fit in tried if fit), key=lambda fit: -fit.agreement)
        heard = [
            fit
            for fit in found
            if fit.agreement > _LEAST_AGREEMENT * found[0].agreement
            and self.has_place(fit)
        ]
        best = heard[0] if heard else None
        for fit in heard[1:] if self.snapshots == 1 else ():
            if best is not None and _earlier(fit, best):
                best = fit
        return best

    def _threshold(self, place: int, stretch: slice) -> float:
        # Windows that overlap by half, with the shape used, are worth half as
        # many independent values; and few of the pairs are independent.
        values = self.recording.weights[stretch].sum() / 2.0
        deviation = 1.0 / math.sqrt(2.0 * (self.shape.count - 1) * values)
        diffuse = float(self.diffuse_response[place])
        least = _LEAST_DIRECT * (1.0 - diffuse)
        return diffuse + max(_DEVIATIONS * deviation, least)

    def _delays(self, place: int, stretch: slice) -> AlignedDelays | None:
        """Delays of the channels, aligned for a place of the grid first."""
        grid = self.grid
        chosen = slice(place, place + 1)
        later = centroid_delays(
            grid.p_AS[chosen], grid.inverse_range[chosen], self.shape, self.c
        )[0]
        return self._delays_at(later, stretch, grid.coarseness)

    def _delays_at(
        self, later: NDArray[np.float64], stretch: slice, coarseness: float = 1.0
    ) -> AlignedDelays | None:
        """Delays of the channels, aligned for these (n,) first, s."""
        rate = self.recording.sample_rate_hz
        lags = np.rint(later * rate).astype(np.int64)
        fit = fit_aligned_delays(
            self.recording.spectra(stretch, lags),
            self.recording.weights[stretch],
            self.recording.angular_frequency,
            coarseness,
        )
        return fit and replace(fit, tau=fit.tau + (lags[1:] - lags[0]) / rate)


def _earlier(one: AlignedDelays, other: AlignedDelays) -> bool:
    """Whether most channels hear both alike, and the rest hear the one earlier."""
    later = np.concatenate(([0.0], other.tau - one.tau))
    for common in later:
        off = later - common
        alike = np.abs(off) < _ALIKE_S
        if 2 * alike.sum() > off.size:
            return bool(np.all(off[~alike] > _EARLIER_S) and not alike.all())
    return False
