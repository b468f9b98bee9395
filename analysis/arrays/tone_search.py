"""Measures the delays of continuous tones from the phases of their lines.

A tone occupies a few frequencies, so that a search over all frequencies finds only
noise. Its phases determine the delays except for whole periods. If only one direction
fits the phases of all microphones, it is the direction of the tone. Otherwise the tone
is ambiguous. The harmonics of one tone come from one direction and have different
periods, so that together they are less ambiguous.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import fft
from scipy.ndimage import median_filter

from analysis.arrays.array_geometry import KnownArray
from analysis.arrays.far_field import locate_far_source
from analysis.arrays.recording_search import Sighting
from analysis.arrays.recording_spectra import RecordingSpectra
from analysis.arrays.source_placement import chi_square_limit, tolerance
from systems.sound.array_shape import ArrayShape

# _WINDOW_S: length of a window, s. In a shorter recording, it is the share _OF_SHORT.
# _STRETCH_S: length of a stretch, s.
# _LEAST_TRAVELS: least length of a window, as a multiple of the travel time.
_WINDOW_S, _OF_SHORT, _STRETCH_S, _LEAST_TRAVELS = 0.064, 0.25, 0.5, 4.0

# A line is a frequency whose power is at least _ABOVE times the median power of the
# frequencies within _AROUND bins. Windows in which a line is fainter than a tenth of
# its mean contain no tone. At most _MOST_LINES lines are used.
_ABOVE, _AROUND, _MOST_LINES = 30.0, 12, 8

# Least share of the power of a recording of tones that belongs to their lines.
_OF_POWER = 0.25

# Largest number of windows in which lines are looked for.
_MOST_WINDOWS = 400

# Lowest frequency of a line, as a share of the lowest frequency of the recording.
_LOWEST = 0.5

# Least share of the power of a line that has the same phases in all windows.
_STEADY = 0.8

# Variance of the gradient of the phase due to echoes, as a multiple of the squared
# gradient of the logarithm of the level, for 1, 2 and 3 components. The fewer the
# components, the more often they are small by chance. For 2 and 3 components, the
# values follow from the 95 % quantiles of Student's distribution; for 1 component, the
# value is that of the 84 % quantile.
_ECHO = (16.0, 4.6, 2.6)

# Gradient of the logarithm of the level that distance alone causes, 1/m: at 2 m.
_DISTANCE = 0.5

# Electrical hum is in phase in all channels. It has lines up to this frequency, Hz.
_HUM_HZ = 1_000.0

# Step of the directions to try, as a phase along the aperture, rad; and largest number
# of directions.
_STEP, _MOST_DIRECTIONS = 0.7, 4_000


class Line(NamedTuple):
    """Phases of one line in a stretch, as delays that exclude whole periods."""

    frequency_hz: float
    tau: NDArray[np.float64]
    """(n - 1,) delays of channels 1 ... n - 1, within half a period, s."""
    covariance: NDArray[np.float64]
    """(n - 1, n - 1) covariance of the delays, s^2."""
    coherence: float
    """Share of the power with the same phases in all windows."""
    power: float


class Tone(NamedTuple):
    """Lines of one source in a stretch."""

    lines: list[Line]
    candidates: list[NDArray[np.float64]]
    """(n - 1,) delays from each direction that fits the phases of all lines, s."""


@dataclass(frozen=True)
class ToneSearch:
    """Search for the delays of tones in each stretch of a recording."""

    recording: RecordingSpectra
    array: KnownArray

    @cached_property
    def size(self) -> int:
        """Number of samples of a window."""
        total = self.recording.channels.shape[1]
        whole = round(_WINDOW_S * self.recording.sample_rate_hz)
        return max(2, min(whole, round(_OF_SHORT * total)))

    @property
    def _windows(self) -> int:
        """Number of windows, which overlap by half."""
        total = self.recording.channels.shape[1]
        return (total - self.size) // self._hop + 1

    @property
    def _hop(self) -> int:
        return max(1, self.size // 2)

    def _spectra(self, windows: NDArray[np.int64]) -> NDArray[np.complex64]:
        """Returns the (n, k, bins) spectra of k windows."""
        all_windows = np.lib.stride_tricks.sliding_window_view(
            self.recording.channels, self.size, axis=1
        )
        shape = np.hanning(self.size).astype(np.float32)
        return fft.rfft(all_windows[:, windows * self._hop] * shape, axis=2)

    @cached_property
    def _power(self) -> NDArray[np.float64]:
        """(bins,) mean power of windows from anywhere in the recording."""
        count = min(self._windows, _MOST_WINDOWS)
        chosen = np.linspace(0, self._windows - 1, count).round().astype(np.int64)
        square = np.abs(self._spectra(chosen)) ** 2
        return np.asarray(np.mean(square, axis=(0, 1), dtype=np.float64))

    @property
    def _bin_hz(self) -> float:
        return self.recording.sample_rate_hz / self.size

    @cached_property
    def lines_hz(self) -> list[float]:
        """Frequencies of the lines in the whole recording, the strongest first."""
        travel = _LEAST_TRAVELS * self.recording.travel_s
        if self.size < travel * self.recording.sample_rate_hz:
            return []
        power = self._power
        floor = median_filter(power, 2 * _AROUND + 1, mode="nearest")
        bins = np.arange(power.size)
        peak = power == np.maximum.reduce([np.roll(power, k) for k in range(-2, 3)])
        low = max(2.0, _LOWEST * self.recording.low_hz / self._bin_hz)
        inside = (bins >= low) & (bins <= self.recording.high_hz / self._bin_hz)
        found = np.flatnonzero(peak & inside & (power > _ABOVE * floor))
        strongest = found[np.argsort(-power[found])][:_MOST_LINES]
        return [float(k * self._bin_hz) for k in strongest]

    @cached_property
    def are_most(self) -> bool:
        """Whether much of the power within the band belongs to lines."""
        if not self.lines_hz:
            return False
        power = self._power
        low, high = self.recording.low_hz, self.recording.high_hz
        band = slice(round(_LOWEST * low / self._bin_hz), round(high / self._bin_hz))
        lines = [round(f / self._bin_hz) for f in self.lines_hz]
        own = {j for k in lines for j in range(k - 2, k + 3)}
        last = min(band.stop, power.size)
        inside = sum(power[j] for j in own if band.start <= j < last)
        return float(inside) > _OF_POWER * float(power[band].sum())

    @cached_property
    def stretches(self) -> list[slice]:
        """Windows of each stretch."""
        count = self._windows
        hop_s = self._hop / self.recording.sample_rate_hz
        parts = max(1, round(count * hop_s / _STRETCH_S))
        edges = np.linspace(0, count, parts + 1).round().astype(int).tolist()
        return [slice(a, b) for a, b in pairwise(edges)]

    @property
    def stretch_s(self) -> float:
        """Duration of a stretch, s."""
        windows = self.stretches[0].stop if self.stretches else 1
        return 0.5 * (windows + 1) * self.size / self.recording.sample_rate_hz

    @cached_property
    def tones(self) -> list[tuple[float, Tone]]:
        """Middle of the stretch, s, and tone, for all tones of all stretches."""
        return [
            (self._middle_s(stretch), tone)
            for stretch in self.stretches
            for tone in self._tones(stretch)
        ]

    def sightings(self) -> list[Sighting]:
        """Returns the tones that come from one direction."""
        return [
            _sighting(t_s, tone)
            for t_s, tone in self.tones
            if len(tone.candidates) == 1
        ]

    def _middle_s(self, stretch: slice) -> float:
        middle = 0.25 * self.size * (stretch.start + stretch.stop + 1)
        return middle / self.recording.sample_rate_hz

    def _tones(self, stretch: slice) -> list[Tone]:
        tones: list[Tone] = []
        for line in self._lines(stretch):
            for k, tone in enumerate(tones):
                fitting = _fitting(tone, line, self.array)
                if fitting:
                    tones[k] = Tone([*tone.lines, line], fitting)
                    break
            else:
                if candidates := _candidates(line, self.array):
                    tones.append(Tone([line], candidates))
        return tones

    def _lines(self, stretch: slice) -> Iterator[Line]:
        rate, hop = self.recording.sample_rate_hz, self._hop
        spectra = self._spectra(np.arange(stretch.start, stretch.stop))
        for frequency in self.lines_hz:
            k = round(frequency / self._bin_hz)
            values = spectra[:, :, k].astype(np.complex128)
            power = np.mean(np.abs(values) ** 2, axis=0)
            values = values[:, power > 0.1 * power.mean()]
            count, windows = values.shape
            cross = values @ values.conj().T / windows
            level, vectors = np.linalg.eigh(cross)
            coherence = float(level[-1] / max(level.sum(), 1e-300))
            if coherence < _STEADY:
                continue
            exact = _exact_hz(values[int(np.argmax(np.abs(vectors[:, -1])))])
            turns = round(frequency * hop / rate - exact) + exact
            wave = vectors[:, -1]
            phase = np.angle(wave[1:] * wave[0].conj())
            w = 2.0 * math.pi * turns * rate / hop
            # Windows that overlap by half contain half as many independent values.
            noise = level[:-1].mean() / max(level[-1] - level[:-1].mean(), 1e-300)
            noise *= count / max(1.0, 0.5 * windows)
            levels = np.abs(wave) * np.array(self.recording.levels or 1.0)
            of_echoes = _echo_covariance(levels, self.array.shape)
            of_noise = 0.5 * noise * (np.eye(count - 1) + 1.0)
            yield Line(
                turns * rate / hop,
                -phase / w,
                (of_noise + of_echoes) / w**2,
                coherence,
                float(level[-1]),
            )


def _echo_covariance(
    levels: NDArray[np.float64], shape: ArrayShape
) -> NDArray[np.float64]:
    """Returns the (n - 1, n - 1) covariance of phases due to echoes, rad^2.

    The echoes of a tone form a steady field with the tone. Its level changes from place
    to place, and its phase deviates from that of a plane wave by as much: the logarithm
    of the field has a complex gradient. The covariance has a part for the gradient, and
    a part for the changes from channel to channel.
    """
    logarithm = np.log(np.maximum(levels, 1e-12))
    logarithm -= logarithm.mean()
    across = shape.p_AM @ shape.span.T
    gradient = np.linalg.lstsq(across, logarithm, rcond=None)[0]
    rest = logarithm - across @ gradient
    turned = across[1:] - across[0]
    square = max(0.0, float(gradient @ gradient) - _DISTANCE**2) / gradient.size
    same = _ECHO[gradient.size - 1] * square * turned @ turned.T
    return np.asarray(same + np.var(rest) * (np.eye(len(turned)) + 1.0))


def _exact_hz(values: NDArray[np.complex128]) -> float:
    """Returns the phase that a line gains from window to window, in turns."""
    if values.size < 2:
        return 0.0
    return float(np.angle(np.sum(values[1:] * values[:-1].conj()))) / (2.0 * math.pi)


def _sighting(t_s: float, tone: Tone) -> Sighting:
    """Combines the lines of a tone, whose delays have a single direction."""
    coherence = float(np.mean([line.coherence for line in tone.lines]))
    weights = [np.linalg.inv(line.covariance) for line in tone.lines]
    covariance = np.linalg.inv(np.sum(weights, axis=0))
    tau = covariance @ np.sum(
        [
            weight @ _unwrapped(line, tone.candidates[0])
            for weight, line in zip(weights, tone.lines, strict=True)
        ],
        axis=0,
    )
    return Sighting(
        tau=tau,
        covariance=covariance,
        coherence=coherence,
        agreement=coherence,
        t_s=t_s,
    )


def _unwrapped(line: Line, tau: NDArray[np.float64]) -> NDArray[np.float64]:
    """Adds the whole periods that bring the delays of a line closest to others."""
    f = line.frequency_hz
    return np.asarray(line.tau + np.rint((tau - line.tau) * f) / f)


def _candidates(line: Line, array: KnownArray) -> list[NDArray[np.float64]]:
    """Returns the delays, with whole periods, of all directions that fit a line."""
    shape, c = array.shape, array.c
    u = _directions(shape, _STEP * c / (2.0 * math.pi * line.frequency_hz))
    expected = u @ (shape.p_AM[0] - shape.p_AM[1:]).T / c
    periods = np.rint((expected - line.tau) * line.frequency_hz)
    tried = [line.tau + m / line.frequency_hz for m in np.unique(periods, axis=0)]
    return [tau for tau in tried if _fits(line, tau, array)]


def _fitting(tone: Tone, line: Line, array: KnownArray) -> list[NDArray[np.float64]]:
    """Returns the candidates of a tone whose direction fits another line, too."""
    return [
        tau
        for tau in tone.candidates
        if _fits(line, _unwrapped(line, tau), array)
        and _is_alike(line, tau, _unwrapped(line, tau), array)
    ]


def _is_alike(
    line: Line,
    one: NDArray[np.float64],
    other: NDArray[np.float64],
    array: KnownArray,
) -> bool:
    """Returns whether two delays differ only by their noise."""
    extra = array.budget.delay_std**2 * (np.eye(one.size) + 1.0)
    off = one - other
    value = float(off @ np.linalg.solve(2.0 * line.covariance + extra, off))
    return value < chi_square_limit(one.size)


def _fits(line: Line, tau: NDArray[np.float64], array: KnownArray) -> bool:
    """Returns whether a plane wave has these delays, and not hum."""
    sighting = Sighting(
        tau=tau,
        covariance=line.covariance,
        coherence=line.coherence,
        t_s=0.0,
    )
    whole = line.covariance + tolerance(sighting, array)
    fix = locate_far_source(tau, whole, array.shape, array.c)
    if fix.chi_square > chi_square_limit(array.shape.freedom + 1):
        return False
    own = line.covariance + array.budget.delay_std**2 * (np.eye(tau.size) + 1.0)
    in_phase = float(tau @ np.linalg.solve(own, tau)) < chi_square_limit(tau.size)
    return not (in_phase and line.frequency_hz < _HUM_HZ)


def _directions(shape: ArrayShape, path: float) -> NDArray[np.float64]:
    """Returns (g, d) directions whose paths along the array differ by about ``path``.

    For microphones in a plane, they include directions above it: the projections of
    such directions on the plane are shorter than 1.
    """
    step = min(path / shape.aperture_m, 0.3)
    rank = len(shape.span)
    if rank < 3:
        line = np.linspace(-1.0, 1.0, 2 * math.ceil(1.0 / step) + 1)
        if line.size**rank > _MOST_DIRECTIONS:
            line = np.linspace(-1.0, 1.0, int(_MOST_DIRECTIONS ** (1.0 / rank)))
        grid = np.stack([g.ravel() for g in np.meshgrid(*[line] * rank)], axis=1)
        inside = np.linalg.norm(grid, axis=1) <= 1.0 + 0.5 * step
        return np.asarray(grid[inside] @ shape.span)
    count = min(math.ceil(4.0 * math.pi / step**2), _MOST_DIRECTIONS)
    height = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    angle = math.pi * (3.0 - math.sqrt(5.0)) * np.arange(count)
    level = np.sqrt(1.0 - height**2)
    return np.stack((level * np.cos(angle), level * np.sin(angle), height), axis=1)
