"""Searches the source position of each stretch of a recording."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.aligned_delays import AlignedDelays, fit_aligned_delays
from analysis.arrays.recording_spectra import RecordingSpectra
from analysis.arrays.steered_response import (
    SearchGrid,
    centroid_delays,
    steered_response,
)
from systems.delays.delay_sets import consistent_lags
from systems.sound.array_shape import ArrayShape

#: Ratio of the standard deviation to the median absolute deviation of normally
#: distributed values.
MAD_TO_STD = 1.4826

# Least mean weight of a stretch with a source. Other stretches are silence or echoes.
_LEAST_WEIGHT = 0.02
# A source needs a response above that of a diffuse field. The difference must exceed
# both limits, because real noise never comes equally from all directions:
# - _DEVIATIONS: in standard deviations of the response to independent noise.
# - _LEAST_DIRECT: as a share of the difference for direct sound alone.
_DEVIATIONS = 5.0
_LEAST_DIRECT = 0.1
# The neighbors of a stretch help to choose among its peaks:
# - _NEIGHBORS: number of neighbors before and after the stretch.
# - _HELP: weight of their mean response.
_NEIGHBORS, _HELP = 4, 0.5
# Several sets of lags are compared for a single short sound, or if the microphone
# positions are too uncertain.
# - _CANDIDATES: largest number of sets.
# - _MISPLACED: positions are too uncertain if their delay error exceeds this share of
#   the shortest period.
# - _LEAST_AGREEMENT: least agreement of a set, as a share of the best agreement. Sets
#   below it are side lobes or echoes.
_CANDIDATES, _MISPLACED, _LEAST_AGREEMENT = 8, 0.5, 0.75
# Direct sound arrives before its echoes, although its delays may agree slightly less:
# - _ALIKE_S: delays within this time of each other count as equal, s.
# - _EARLIER_S: a delay counts as earlier if the difference exceeds this time, s.
_ALIKE_S, _EARLIER_S = 1e-4, 4e-4


@dataclass(frozen=True)
class Sighting(AlignedDelays):
    """A stretch of the recording in which one source position stands out.

    The search shifts the channels in time before it fits delays. The delays ``tau`` are
    the sum of shift and fitted delay. The coherence is the share of the sound that
    arrives directly from the source.
    """

    t_s: float
    """Middle of the stretch, s from the start of the recording."""


@dataclass(frozen=True)
class RecordingSearch:
    """Search for the source in each stretch of a recording.

    A stretch is a run of snapshots. A snapshot is a short window of the recording.
    """

    recording: RecordingSpectra
    shape: ArrayShape
    c: float
    snapshots: int
    """Number of snapshots per stretch. Stretches overlap by half if there are several
    snapshots."""
    slack_s: float = 0.0
    """Time by which delays may exceed the limit from the stated positions, s."""
    has_place: Callable[[AlignedDelays], bool] = field(default=lambda _: True)
    """Function that returns whether delays fit some source position. It is called if
    there are several sets of delays to choose from."""

    @cached_property
    def stretches(self) -> list[slice]:
        """Snapshots of each stretch, as slices."""
        count = len(self.recording.starts)
        if not count:
            return []
        size = min(self.snapshots, count)
        firsts = range(0, count - size + 1, max(1, size // 2))
        return [slice(k, k + size) for k in firsts]

    @property
    def stretch_s(self) -> float:
        """Duration of a stretch, s."""
        count = self.stretches[0].stop if self.stretches else 1
        samples = self.recording.window.size + (count - 1) * self.recording.hop
        return samples / self.recording.sample_rate_hz

    @cached_property
    def grid(self) -> SearchGrid:
        """Positions to search."""
        rate = self.recording.sample_rate_hz
        window_s = self.recording.window.size / rate
        return SearchGrid.of(self.shape, self.c, self.recording.high_hz, window_s)

    def _responses(self, cross: NDArray[np.complex64]) -> NDArray[np.float32]:
        correlations = self.grid.correlations(cross, self.recording.bins)
        return steered_response(correlations, self.grid)

    @cached_property
    def diffuse_response(self) -> NDArray[np.float32]:
        """(g,) response of each grid position to equal sound from all directions."""
        weights = self.recording.weights.mean(axis=0, dtype=np.float64)
        cross = self.diffuse_coherence * (weights / max(weights.sum(), 1e-30))
        return self._responses(cross.astype(np.complex64))

    @cached_property
    def diffuse_coherence(self) -> NDArray[np.float64]:
        """(p, f) coherence of equal sound from all directions between the pairs."""
        phase = np.outer(self.shape.distances_m, self.recording.angular_frequency)
        return np.sinc(phase / (math.pi * self.c))

    def mean_response(self) -> float:
        """Computes the weighted mean of the greatest responses of all stretches.

        The mean measures how well all pairs of channels agree on a source position.
        """
        weights = [float(self.recording.weights[s].mean()) for s in self.stretches]
        best = [
            float(self._stretch_response(s, w).max())
            for s, w in zip(self.stretches, weights, strict=True)
        ]
        return float(np.average(best, weights=np.array(weights) + 1e-30))

    def sightings(self) -> Iterator[Sighting]:
        """Finds the stretches that have a source, in the order of time."""
        held: deque[tuple[slice, float, NDArray[np.float32]]] = deque()
        near = np.zeros(len(self.grid.lags))
        weight = 0.0
        queue = iter(self.stretches)
        middle = 0
        for k in range(len(self.stretches) + _NEIGHBORS):
            new = next(queue, None)
            if new is not None:
                value = float(self.recording.weights[new].mean())
                response = self._stretch_response(new, value)
                held.append((new, value, response))
                near += value * response
                weight += value
            if k < _NEIGHBORS:
                continue
            stretch, value, response = held[middle]
            found = self._sighting(stretch, value, response, near / max(weight, 1e-30))
            if found is not None:
                yield found
            middle += 1
            if middle > _NEIGHBORS:
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
        """Returns (p, f) whitened and weighted cross-spectra of the pairs."""
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
        """Returns the delays with the best agreement that also fit a source position.

        Several sets of delays are compared, because the grid position with the greatest
        response can be wrong for two reasons:

        - In a short window, the echo at one microphone may be as strong as the sound. A
          wrong position may then have the greatest response, although not all pairs
          agree on it.
        - If the microphones are not at their stated positions, the nearest grid
          position may lie on a side lobe instead of the peak.
        """
        weight = float(self.recording.weights[stretch].sum())
        rate = self.grid.lag_rate_hz
        slack = math.ceil(self.slack_s * rate)
        reach = np.ceil(self.shape.distances_m / self.c * rate).astype(np.int64)
        cross = self._cross(stretch) / weight
        sets = consistent_lags(
            self.grid.correlations(cross, self.recording.bins, slack),
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
        # Windows that overlap by half contain half as many independent values. Few of
        # the pairs are independent, too.
        values = self.recording.weights[stretch].sum() / 2.0
        deviation = 1.0 / math.sqrt(2.0 * (self.shape.count - 1) * values)
        diffuse = float(self.diffuse_response[place])
        least = _LEAST_DIRECT * (1.0 - diffuse)
        return diffuse + max(_DEVIATIONS * deviation, least)

    def _delays(self, place: int, stretch: slice) -> AlignedDelays | None:
        grid = self.grid
        chosen = slice(place, place + 1)
        later = centroid_delays(
            grid.p_AS[chosen], grid.inverse_range[chosen], self.shape, self.c
        )[0]
        return self._delays_at(later, stretch, grid.coarseness)

    def _delays_at(
        self, later: NDArray[np.float64], stretch: slice, coarseness: float = 1.0
    ) -> AlignedDelays | None:
        """Estimates delays after shifting the channels by (n,) given delays, s."""
        rate = self.recording.sample_rate_hz
        lags = np.rint(later * rate).astype(np.int64)
        w = self.recording.angular_frequency
        first, second = self.shape.pairs.T
        aligned = np.exp(1j * np.outer(lags[second] - lags[first], w / rate))
        fit = fit_aligned_delays(
            self.recording.spectra(stretch, lags),
            self.recording.weights[stretch],
            w,
            coarseness,
            diffuse=(self.diffuse_coherence * aligned).astype(np.complex64),
        )
        return fit and replace(fit, tau=fit.tau + (lags[1:] - lags[0]) / rate)


def _earlier(one: AlignedDelays, other: AlignedDelays) -> bool:
    """Returns whether ``one`` is earlier than ``other`` in some of the channels.

    In all other channels, which must be more than half, the two sets of delays must be
    equal.
    """
    later = np.concatenate(([0.0], other.tau - one.tau))
    for common in later:
        off = later - common
        alike = np.abs(off) < _ALIKE_S
        if 2 * alike.sum() > off.size:
            return bool(np.all(off[~alike] > _EARLIER_S) and not alike.all())
    return False
