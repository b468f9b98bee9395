"""Finds channels that are not aligned in time with the others.

There are two faults. Channels of another sound card or recorder may begin later than
the others, so that their delays are longer than the array allows from the first to the
last sample. Or a channel loses samples, so that all of its delays jump at one time. A
channel that falls silent or noisy shows in the same delays, because it then has no
delays at all.

The delays are the peaks of cross-correlations with the phase transform (Knapp and
Carter 1976). Sound from a source that moves, or from one talker after another, changes
the delays as a wave front does. Lost samples change only the delays of their channel.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import fft
from scipy.sparse.csgraph import connected_components

from analysis.arrays.array_geometry import (
    HIGHEST_FAULTS_HZ,
    KnownArray,
    usable_band,
)
from analysis.arrays.channel_fault import ChannelFault, channel_names
from analysis.arrays.frame_delays import REACHES_M
from systems.delays.correlations import correlations_at_lags, parabola_vertex
from systems.sound.array_shape import ArrayShape

# Largest lateness that the search finds, s.
_REACH_S = 0.25

# _BLOCK_S: least length of a block, s. Longer lateness needs longer blocks.
# _BLOCKS: number of loudest blocks to use.
_BLOCK_S, _BLOCKS = 1.0, 4

# Channels that are compared with all others. A fault of one of them still leaves others
# to compare with.
_REFERENCES = 3

# Least height of a peak, in root-mean-square values of the correlation. The maximum of
# noise over 10 000 lags is 4.
_STANDS_OUT = 6.0

# An impossible delay must have a peak this many times as high as that of the highest
# possible delay: in one stretch, and in the mean of several blocks. Echoes and
# repetitions of a sound are lower.
_HIGHER, _HIGHER_MEAN = 2.0, 1.5

# Ratio of a delay to the longest delay that the array allows. Up to this ratio, errors
# of the positions can explain the delay.
_ALLOWED = 1.15

# If one wave front fits delays that are up to this many times too long, the positions
# are wrong rather than the clocks.
_OTHER_UNITS = 3.5

# Ratios of common units of length: centimeters or millimeters, and inches. Delays whose
# wave front is slower by such a ratio, within the share _NEAR_UNITS, are those of
# positions in another unit.
_UNITS, _NEAR_UNITS = np.array([10.0, 25.4, 39.4, 100.0, 1000.0]), 0.05

# Largest misfit of a wave front, as a share of the longest delay. Near sources cause
# curved wave fronts. The smaller share applies if delays are only a few times too long.
# An array is flat if its thickness is below the share _THIN of its size.
_FLAT, _FLATTER, _THIN = 0.15, 0.1, 0.3

# Least number of channels whose delays confirm that one of them is late. The only
# delay of two may be a chance peak of tones.
_CONFIRMED = 3

# Largest difference between a delay and the sum of two others that agree with it, in
# addition to two samples, s.
_AGREE_S = 2e-4

# Strength of the cross-spectrum, as a share of its mean, at which a bin counts half. A
# tone without noise would otherwise be a matter of its rounding.
_FLOOR = 1e-3

# Number of points of the correlation per period of the highest frequency.
_DENSITY = 8


@dataclass(frozen=True)
class LagSearch:
    """Search for the delays of channels over far more than the array allows."""

    shape: ArrayShape
    c: float
    """Speed of sound, m/s."""
    sample_rate_hz: float
    band_hz: tuple[float, float]
    numbers: tuple[int, ...]
    """Numbers of the n channels in faults, counted from 0."""

    @classmethod
    def of(
        cls,
        array: KnownArray,
        sample_rate_hz: float,
        band_hz: tuple[float, float] | None,
        numbers: Sequence[int],
    ) -> LagSearch:
        """Makes the search for at least three of the channels of an array.

        If ``band_hz`` is None, the band is the default band of the fault checks.
        """
        band = usable_band(band_hz, sample_rate_hz, highest_hz=HIGHEST_FAULTS_HZ)
        shape = ArrayShape.of(array.shape.p_AM[list(numbers)])
        return cls(shape, array.c, sample_rate_hz, band, tuple(numbers))

    @property
    def pairs(self) -> NDArray[np.int64]:
        """(p, 2) numbers of the channels of each pair, with i < j."""
        count = self.shape.count
        references = {count * k // _REFERENCES for k in range(_REFERENCES)}
        pairs = {
            (min(r, k), max(r, k)) for r in references for k in range(count) if k != r
        }
        return np.array(sorted(pairs), dtype=np.int64)

    @property
    def allowed_s(self) -> NDArray[np.float64]:
        """(p,) longest plausible delay of each pair, s."""
        i, j = self.pairs.T
        apart = np.linalg.norm(self.shape.p_AM[i] - self.shape.p_AM[j], axis=1)
        return _ALLOWED * apart / self.c + 2.0 / self.sample_rate_hz

    def lags(
        self, blocks: Sequence[NDArray[np.floating]], reach_s: float
    ) -> NDArray[np.float64]:
        """Measures the (p,) delays t_j - t_i of the pairs in (n, k) blocks, s.

        A delay is NaN if the pair has no sound in common. The search covers delays up
        to ``reach_s``.
        """
        pairs, length = self.pairs, blocks[0].shape[1]
        i, j = pairs.T
        size = int(fft.next_fast_len(2 * length, real=True))
        low, high = (math.ceil(f * size / self.sample_rate_hz) for f in self.band_hz)
        band = slice(low, min(high, size // 2) + 1)
        cross = np.zeros((len(pairs), band.stop - band.start), np.complex64)
        window = np.hanning(length) if len(blocks) == 1 else np.ones(length)
        for block in blocks:
            level = block - block.mean(axis=1, keepdims=True)
            spectra = fft.rfft((level * window).astype(np.float32), size)[:, band]
            of_block = spectra[i].conj() * spectra[j]
            strength = np.abs(of_block)
            floor = _FLOOR * strength.mean(axis=1, keepdims=True)
            cross += of_block / (strength + floor + np.finfo(np.float32).tiny)
        # The result has only as many points as the highest frequency needs.
        points = int(fft.next_fast_len(_DENSITY * band.stop // 2, real=True))
        points = max(points, 2 * band.stop)
        rate = points / size * self.sample_rate_hz
        reach = min(round(reach_s * rate), points // 2 - 1)
        values = correlations_at_lags(cross, band, points, reach)
        at = np.arange(-reach, reach + 1) / rate
        inside = np.abs(at) <= self.allowed_s[:, np.newaxis]
        within = np.where(inside, values, -np.inf)
        higher = _HIGHER if len(blocks) == 1 else _HIGHER_MEAN
        best = np.where(
            values.max(axis=1) > higher * within.max(axis=1),
            values.argmax(axis=1),
            within.argmax(axis=1),
        )
        rows = np.arange(len(pairs))
        heard = values[rows, best] > _STANDS_OUT * np.sqrt(np.mean(values**2, axis=1))
        best = np.clip(best, 1, 2 * reach - 1)
        left, top, right = (values[rows, best + k] for k in (-1, 0, 1))
        lags = (best - reach + parabola_vertex(left, top, right)) / rate
        return np.where(heard, lags, np.nan)


@dataclass(frozen=True)
class LateChannels(ChannelFault):
    """A fault of channels that are not aligned in time with the others."""

    seconds: float
    """Smallest difference in time between two groups of channels, s."""


def unaligned_channels(
    samples: NDArray[np.float64], search: LagSearch
) -> LateChannels | None:
    """Finds channels of an (n, k) recording without NaN that are late throughout."""
    rate, total = search.sample_rate_hz, samples.shape[1]
    most_s = search.shape.max_delay(search.c)
    length = min(round(max(_BLOCK_S, 4.0 * most_s) * rate), total)
    starts = range(0, total - length + 1, length)
    power = [float(np.var(samples[:, k : k + length])) for k in starts]
    chosen = np.sort(np.argsort(power)[::-1][:_BLOCKS])
    blocks = [samples[:, starts[k] : starts[k] + length] for k in chosen]
    reach_s = min(_REACH_S + most_s, 0.5 * length / rate)
    lags = search.lags(blocks, reach_s)
    if not np.any(np.abs(lags) > search.allowed_s):
        return None
    arrival = _arrivals(lags, search)
    heard = np.flatnonzero(np.isfinite(arrival))
    if heard.size < _CONFIRMED:
        return None
    t, p = arrival[heard], search.shape.p_AM[heard]
    apart = np.linalg.norm(p[:, np.newaxis] - p, axis=2)
    together = np.abs(t[:, np.newaxis] - t) <= (
        _ALLOWED * apart / search.c + 2.0 / rate
    )
    number, group = connected_components(together)
    one = _odd_one(together) if number == 1 else None
    if number == 1 and one is None:
        return None
    if one is not None:
        group = (np.arange(len(t)) == one).astype(np.int32)
    sizes = np.bincount(group)
    paths = np.abs(t[:, np.newaxis] - t) - 2.0 / rate
    ratio = float((paths * search.c / np.where(apart > 0.0, apart, np.inf)).max())
    # The positions may be wrong instead.
    if _in_other_units(t, p, search.c):
        misplaced = True
    elif one is not None or ratio < _OTHER_UNITS:
        longest_s = _ALLOWED * float(apart.max()) / search.c
        few = bool(2 * sizes.max() <= len(t))
        misplaced = few or bool(np.ptp(t) < longest_s) or _fits(t, p, search.c)
    else:
        misplaced = bool(sizes.size > 2) and (_fits_any(t, p) or _is_wave(t, p, _FLAT))
    if misplaced:
        return None
    numbers = np.array(search.numbers)[heard]
    return _late_fault(t, p, numbers, group, search.c)


def _odd_one(together: NDArray[np.bool_]) -> int | None:
    """Returns the only channel without which all pairs of channels are together."""
    apart = ~together
    pairs = apart.sum()
    (odd,) = np.nonzero(2 * apart.sum(axis=0) == pairs)
    return int(odd[0]) if pairs and odd.size == 1 else None


def _late_fault(
    t: NDArray[np.float64],
    p: NDArray[np.float64],
    numbers: NDArray[np.int64],
    group: NDArray[np.int32],
    c: float,
) -> LateChannels:
    sizes = np.bincount(group)
    means = np.array([t[group == g].mean() for g in range(sizes.size)])
    # The largest group is right. Among equal groups, it is the earliest one.
    right = int(np.lexsort((means, -sizes))[0])
    others = sorted(set(range(sizes.size)) - {right}, key=lambda g: float(means[g]))
    # Unknowns are the slowness and the lateness of each group. The slowness of sound
    # keeps a group of one channel from hiding in it.
    members = [(group == g).astype(float) for g in (right, *others)]
    a = np.column_stack([-p / c, *members])
    prior = np.eye(p.shape[1], a.shape[1]) * 0.1 * max(np.ptp(p) / c, 1e-6)
    solution = np.linalg.lstsq(
        np.vstack((a, prior)), np.append(t, np.zeros(len(prior))), rcond=None
    )[0][p.shape[1] :]
    late = solution[1:] - solution[0]
    said = [
        f"{channel_names(numbers[group == g].tolist())} {_ms(by)} "
        f"{'late' if by > 0.0 else 'early'}"
        for g, by in zip(others[:3], late, strict=False)
    ]
    more = " ..." if len(others) > 3 else ""
    channels = tuple(int(k) for k in numbers[group != right])
    reference = channel_names(numbers[group == right].tolist())
    text = (
        f"{', '.join(said)}{more} against {reference}; align the channels in time, or "
        "record all of them with one device"
    )
    return LateChannels("unaligned", channels, text, float(np.abs(late).min()))


def _ms(seconds: float) -> str:
    return f"{1e3 * abs(seconds):.1f} ms"


def _arrivals(lags: NDArray[np.float64], search: LagSearch) -> NDArray[np.float64]:
    """Returns (n,) times of arrival from the reference that agrees with most lags.

    A channel that this reference does not hear has the value NaN.
    """
    count = search.shape.count
    later = np.full((count, count), np.nan)
    later[tuple(search.pairs.T)] = lags
    later[tuple(search.pairs.T[::-1])] = -lags
    np.fill_diagonal(later, 0.0)
    # An echo may be higher than the direct peak of one pair.
    off = np.abs(later[:, np.newaxis] - later[:, :, np.newaxis] - later)
    agrees = off < _AGREE_S + 2.0 / search.sample_rate_hz
    return later[int(np.argmax(agrees.sum(axis=(1, 2))))]


def _is_wave(t: NDArray[np.float64], p: NDArray[np.float64], share: float) -> bool:
    """Returns whether a plane wave of any speed explains (n,) times at (n, d) places.

    Its largest misfit is a share of the longest delay.
    """
    centered, inverse = _flattened(p)
    later = t - t.mean()
    off = later - centered @ (inverse @ later)
    return float(np.abs(off).max()) < share * float(np.ptp(t))


def _fits_any(t: NDArray[np.float64], p: NDArray[np.float64]) -> bool:
    """Returns whether the microphones are so few that a wave explains any times."""
    return bool(np.linalg.matrix_rank(_flattened(p)[1]) >= len(t) - 1)


def _fits(t: NDArray[np.float64], p: NDArray[np.float64], c: float) -> bool:
    """Returns whether positions in other units explain (n,) times.

    If a wave explains any times, it must be plausibly slow.
    """
    if not _fits_any(t, p):
        return _is_wave(t, p, _FLATTER)
    slowness = np.linalg.norm(_flattened(p)[1] @ (t - t.mean()))
    return float(slowness) * c < _OTHER_UNITS


def _in_other_units(t: NDArray[np.float64], p: NDArray[np.float64], c: float) -> bool:
    """Returns whether positions of four microphones in space are in another unit.

    For four microphones in space, some plane wave explains any arrival times. Its
    speed shows the unit of the positions. The function examines no other arrays.
    """
    centered = p - p.mean(axis=0)
    if len(t) != 4 or np.linalg.matrix_rank(_flattened(p)[1]) < 3:
        return False
    ratio = np.linalg.norm(np.linalg.solve(centered[1:], t[1:] - t.mean())) * c
    true_m = ratio * 2.0 * np.linalg.norm(centered, axis=1).max()
    alike = np.any(np.abs(ratio / _UNITS - 1.0) < _NEAR_UNITS)
    return bool(alike and true_m < max(REACHES_M))


def _flattened(
    p: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns (n, d) centered places, and their inverse without a thin dimension."""
    centered = p - p.mean(axis=0)
    return centered, np.linalg.pinv(centered, rcond=_THIN)
