"""Searches the delays of single calls at recorders that are far apart.

Sound takes longer from one recorder to the next than a call lasts. No window then
contains the same sound in all channels, and the grid of positions would have too many
points. Instead, the search finds a call in the channel in which it is clearest, and
looks for the same call in all other channels, as far as the sound can travel. The call
need not be audible at all recorders.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from analysis.arrays.aligned_delays import fit_aligned_delays
from analysis.arrays.array_geometry import KnownArray
from analysis.arrays.recording_search import Sighting
from analysis.arrays.recording_spectra import RecordingSpectra
from analysis.arrays.standing_sounds import StandingSound, sounding_band, standing_sound
from systems.delays.correlations import correlations_at_lags
from systems.delays.delay_sets import consistent_lags

# _PAUSE_S: a longer pause separates two calls, s.
# _LONGEST_S: longest part of a sound that counts as one call, s.
_PAUSE_S, _LONGEST_S = 0.05, 2.0
# Least excess of a call, as a share of the excess of the clearest call, and at all. The
# excess is the power above the noise, summed over the cells of time and frequency.
_FAINTEST, _LEAST_EXCESS = 0.02, 60.0
_MOST_CALLS = 64

# Least correlation of two channels with the same call, in standard deviations of the
# correlation at other lags.
_STANDS_OUT = 5.0

# Least coherence of two channels with the same call, after they are shifted by at most
# _OFF samples from the lags. Parts of noise that happen to be loud have less.
_LEAST_COHERENCE, _OFF = 0.25, 2

# Largest error of the distances and of the speed of sound, in standard deviations.
_DEVIATIONS = 4.0

# Number of sets of lags to compare.
_CANDIDATES = 4

# Columns of a correlation per sample.
_DENSITY = 2


class Call(NamedTuple):
    """A call in the channel in which it is clearest."""

    channel: int
    first: int
    """First sample."""
    last: int
    """Sample after the last one."""


@dataclass(frozen=True)
class CallSearch:
    """Search for the delays of each call in a recording of n recorders."""

    channels: NDArray[np.float32]
    """(n, samples) recorded sound."""
    sample_rate_hz: float
    band_hz: tuple[float, float]
    array: KnownArray

    @classmethod
    def of(cls, recording: RecordingSpectra, array: KnownArray) -> CallSearch:
        """Makes the search for the calls in the channels of a recording."""
        return cls(
            recording.channels,
            recording.sample_rate_hz,
            (recording.low_hz, recording.high_hz),
            array,
        )

    @cached_property
    def sounds(self) -> list[StandingSound]:
        """Sound of each channel without noise."""
        return [
            standing_sound(row, self.sample_rate_hz, self.band_hz)
            for row in self.channels
        ]

    @cached_property
    def travel(self) -> NDArray[np.int64]:
        """(n, n) longest possible delays between channels, samples."""
        p, c, budget = self.array.shape.p_AM, self.array.c, self.array.budget
        apart = np.linalg.norm(p[:, np.newaxis] - p, axis=2)
        longer = np.hypot(
            math.sqrt(2.0) * budget.position_std, apart * budget.speed_std / c
        )
        longest_s = (apart + _DEVIATIONS * longer) / c
        return np.ceil(longest_s * self.sample_rate_hz).astype(np.int64)

    @cached_property
    def stretches(self) -> list[Call]:
        """The calls, in the order in which they were found."""
        return [call for call, _ in self._found]

    @cached_property
    def found_band_hz(self) -> tuple[float, float]:
        """Band that contains the sounds of all channels, Hz."""
        of_bins = np.sum([sound.of_bins for sound in self.sounds], axis=0)
        whole = self.sounds[0]._replace(of_bins=of_bins)
        return sounding_band(whole, self.sample_rate_hz) or self.band_hz

    @property
    def stretch_s(self) -> float:
        """Median duration of a call, s."""
        lengths = [call.last - call.first for call in self.stretches]
        return float(np.median(lengths or [0])) / self.sample_rate_hz

    def sightings(self) -> list[Sighting]:
        """Returns the calls whose delays are known, in the order of time."""
        known = [sighting for _, sighting in self._found if sighting is not None]
        return sorted(known, key=lambda sighting: sighting.t_s)

    @cached_property
    def _found(self) -> list[tuple[Call, Sighting | None]]:
        return list(self._search())

    def _search(self) -> Iterator[tuple[Call, Sighting | None]]:
        step = self.sounds[0].step
        excess = np.array([sound.excess for sound in self.sounds], dtype=np.float64)
        clearest = 0.0
        for _ in range(_MOST_CALLS):
            call, size = self._clearest_call(excess)
            clearest = max(clearest, size)
            if size < max(_LEAST_EXCESS, _FAINTEST * clearest):
                return
            lags, sighting = self._delays(call)
            for k, lag in lags.items():
                first, last = (max(0, at + lag) // step for at in call[1:])
                excess[k, first : last + 2] = 0.0
            yield call, sighting

    def _clearest_call(self, excess: NDArray[np.float64]) -> tuple[Call, float]:
        """Returns the part of a channel with the most excess, and its excess."""
        step = self.sounds[0].step
        pause = max(2, math.ceil(_PAUSE_S * self.sample_rate_hz / step))
        longest = max(2, math.ceil(_LONGEST_S * self.sample_rate_hz / step))
        best, size = Call(0, 0, 0), 0.0
        for k, row in enumerate(excess):
            sounding = np.flatnonzero(row)
            if not sounding.size:
                continue
            parts = np.split(sounding, np.flatnonzero(np.diff(sounding) > pause) + 1)
            for part in parts:
                for at in range(0, part.size, longest):
                    some = part[at : at + longest]
                    if (value := float(row[some].sum())) > size:
                        best = Call(k, (some[0] - 1) * step, (some[-1] + 1) * step)
                        size = value
        return best, size

    def _delays(self, call: Call) -> tuple[dict[int, int], Sighting | None]:
        """Returns the lags of a call in the channels that hear it, and its delays."""
        whole = {call.channel: 0}
        others = set(range(self.array.shape.count)) - {call.channel}
        order = [call.channel, *sorted(others)]
        heard = self._heard_lags(call, order)
        whole |= heard
        if len(whole) < 3:
            return whole, None
        channels = sorted(whole)
        lags = np.array([whole[k] for k in channels])
        pieces = self._pieces(call, channels, lags)
        power = np.mean(pieces**2, axis=1, keepdims=True) + np.finfo(np.float32).tiny
        size = fft.next_fast_len(2 * pieces.shape[1], real=True)
        spectra = fft.rfft(pieces / np.sqrt(power), size)
        f = fft.rfftfreq(size, 1.0 / self.sample_rate_hz)
        inside = (f >= self.band_hz[0]) & (f <= self.band_hz[1])
        spectra = spectra[:, np.newaxis, inside].astype(np.complex64)
        weights = _share_of_sound(spectra)
        fit = fit_aligned_delays(spectra, weights, 2.0 * math.pi * f[inside])
        if fit is None:
            return whole, None
        rate = self.sample_rate_hz
        tau = fit.tau + (lags[1:] - lags[0]) / rate
        later, covariance = self._of_all(channels, tau, fit.covariance)
        middle = 0.5 * (call.first + call.last) / rate
        return whole, Sighting(
            tau=later,
            covariance=covariance,
            coherence=fit.coherence,
            agreement=fit.agreement,
            t_s=middle,
        )

    def _of_all(
        self,
        channels: list[int],
        tau: NDArray[np.float64],
        covariance: NDArray[np.float64],
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Returns delays and covariance of all channels after channel 0.

        A channel that does not hear the call has the largest possible error.
        """
        n = self.array.shape.count
        at, of_at = np.zeros(n), np.zeros((n, n))
        at[channels[1:]] = tau
        of_at[np.ix_(channels[1:], channels[1:])] = covariance
        deaf = np.setdiff1d(np.arange(n), channels)
        at[deaf] = at[channels].mean()
        of_at[deaf, deaf] = self.array.shape.max_delay(self.array.c) ** 2
        after = np.hstack((-np.ones((n - 1, 1)), np.eye(n - 1)))
        return after @ at, after @ of_at @ after.T

    def _pieces(
        self, call: Call, channels: list[int], lags: NDArray[np.int64]
    ) -> NDArray[np.float64]:
        """Returns the (k, m) samples of a call in k channels, shifted by the lags."""
        take = np.arange(call.first, call.last)
        out = np.zeros((len(channels), take.size))
        for row, k, lag in zip(out, channels, lags, strict=True):
            samples = self.sounds[k].samples
            inside = (take + lag >= 0) & (take + lag < samples.size)
            row[inside] = samples[(take + lag)[inside]]
        return out

    def _heard_lags(self, call: Call, order: list[int]) -> dict[int, int]:
        """Returns the lags of the other channels that hear a call, samples."""
        rate, most = self.sample_rate_hz, int(self.travel[call.channel].max())
        width = call.last - call.first + 2 * most
        size = fft.next_fast_len(2 * width, real=True)
        spectra = []
        for k in order:
            reach = int(self.travel[call.channel, k])
            around = call._replace(first=call.first - reach, last=call.last + reach)
            piece = self._pieces(around, [k], np.zeros(1, dtype=np.int64))[0]
            padded = np.zeros(width)
            padded[most - reach : most - reach + piece.size] = piece
            spectrum = fft.rfft(padded, size)
            spectra.append(spectrum / max(float(np.linalg.norm(spectrum)), 1e-30))
        f = fft.rfftfreq(size, 1.0 / rate)
        inside = np.flatnonzero((f >= self.band_hz[0]) & (f <= self.band_hz[1]))
        band = slice(inside[0], inside[-1] + 1)
        all_spectra = np.array(spectra)[:, band].astype(np.complex64)
        flat = _whitened(all_spectra)
        n = len(order)
        pairs = np.stack(np.triu_indices(n, 1), axis=1)
        reach = _DENSITY * self.travel[np.ix_(order, order)][tuple(pairs.T)]
        values = np.empty((len(pairs), 2 * int(reach.max()) + 1), dtype=np.float32)
        for row, (i, j) in zip(values, pairs, strict=True):
            cross = (flat[i].conj() * flat[j])[np.newaxis]
            row[:] = correlations_at_lags(
                cross, band, _DENSITY * size, int(reach.max())
            )[0]
        # In units of the deviation of the correlation at other lags.
        middle = int(reach.max())
        inside_reach = np.abs(np.arange(-middle, middle + 1)) <= reach[:, np.newaxis]
        square = np.mean(values**2, axis=1, where=inside_reach, keepdims=True)
        values /= np.sqrt(np.maximum(square, 1e-30))
        sets = consistent_lags(values, pairs, reach, _CANDIDATES)
        if not sets:
            return {}
        best: dict[int, int] = {}
        score = 0.0
        for lags in sets:
            at = middle + lags[pairs[:, 1]] - lags[pairs[:, 0]]
            table = np.zeros((n, n))
            table[tuple(pairs.T)] = [
                row[max(0, a - 2) : a + 3].max(initial=0.0)
                for row, a in zip(values, at, strict=True)
            ]
            samples = np.rint(lags / _DENSITY).astype(np.int64)
            alike = self._coherence(call, order, samples) > _LEAST_COHERENCE
            table = np.where(alike, table + table.T, 0.0)
            members = _agreeing(table)
            total = float(table[np.ix_(members, members)].sum())
            if total > score:
                score = total
                best = {order[k]: int(samples[k]) for k in members[1:]}
        return best

    def _coherence(
        self, call: Call, order: list[int], lags: NDArray[np.int64]
    ) -> NDArray[np.float64]:
        """Returns the (n, n) coherences of the channels, shifted by the lags."""
        pieces = self._pieces(call, order, lags)
        size = fft.next_fast_len(2 * pieces.shape[1], real=True)
        flat = _whitened(fft.rfft(pieces, size).astype(np.complex64))
        flat /= np.linalg.norm(flat, axis=1, keepdims=True) + np.finfo(np.float32).tiny
        turn = 2.0 * math.pi * np.arange(flat.shape[1]) / size
        shifts = np.arange(-_OFF, _OFF + 1)
        return np.asarray(
            np.max(
                [np.real(flat.conj() * np.exp(1j * turn * k) @ flat.T) for k in shifts],
                axis=0,
            )
        )


def _agreeing(table: NDArray[np.float64]) -> list[int]:
    """Returns the channels that agree with channel 0, and on average with each other.

    The (n, n) table has the correlation of each pair.
    """
    members, rest = [0], set(range(1, len(table)))
    while rest:
        means = {k: float(table[k, members].mean()) for k in rest}
        best = max(rest, key=means.__getitem__)
        if means[best] < _STANDS_OUT:
            break
        members.append(best)
        rest.remove(best)
    return members


def _whitened(spectra: NDArray[np.complex64]) -> NDArray[np.complex64]:
    """Flattens (n, f) spectra where they are strong, and keeps the rest weak."""
    size = np.abs(spectra)
    floor = size.mean(axis=1, keepdims=True) + np.finfo(np.float32).tiny
    return spectra / (size + floor)


def _share_of_sound(spectra: NDArray[np.complex64]) -> NDArray[np.float32]:
    """Returns the (1, f) weights of frequencies, near 1 where the sound is strong."""
    power = np.mean(np.abs(spectra) ** 2, axis=0)
    return (power / (power + power.mean())).astype(np.float32)
