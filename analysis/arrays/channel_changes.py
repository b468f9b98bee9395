"""Finds channels that change within a recording: they lose samples, or fall silent.

If a channel loses samples, all of its delays jump at one time, while the delays of the
other channels stay. A wave front from elsewhere changes more delays than these. Unless
the microphones are so few that a wave front explains the jump, the jump shows a fault.

If a channel falls silent or noisy, it loses its delays, while the other channels still
have delays among themselves.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from analysis.arrays.channel_fault import ChannelFault, channel_names
from analysis.arrays.channel_timing import LagSearch
from analysis.arrays.known_medians import known_medians

# _STRETCH_S: shortest and longest stretch, s.
# _STRETCHES: number of stretches in a recording, as far as this range allows.
# _MOST: largest number of stretches. Longer recordings are examined in part.
_STRETCH_S, _STRETCHES, _MOST = (0.2, 0.5), 24, 240

# Largest jump that the search finds, s.
_REACH_S = 0.1

# _LEAST: least number of stretches with sound before and after a change.
# _MANY: number of stretches with sound on either side that suffice.
_LEAST, _MANY = 3, 12

# Least size of a jump: as a share of the sample interval, because whole samples are
# lost, and in standard deviations.
_LEAST_SAMPLES, _DEVIATIONS = 0.7, 6.0

# Jumps of fewer samples than _FEW are within _OFF_WHOLE of a whole number.
_FEW, _OFF_WHOLE = 3.0, 0.2

# Largest error of the delays that a jump explains: the smaller one of a share of the
# jump and a share of the longest delay, in addition to standard deviations.
_SHARE, _STILL, _WITHIN = 0.15, 0.1, 3.0

# Least share of the stretches that keep their delays on either side of a jump.
_KEPT = 0.8

# Error of the delay of a stretch of speech in a room, s. Delays differ by this, and by
# a quarter of the jump, from those on their side of the jump.
_ROOM_S = 1e-5

# Least standard deviation of a delay, as a share of the sample interval.
_FLOOR_SAMPLES = 0.05

# Largest ratio of the slowness of a wave front to that of sound in the stated air.
_SLOWEST = 1.15

# Distance of a near source from a small array, m.
_NEAR_M = 0.5

# Largest probability that a fault is a chance: that a sound channel has no delays, and
# that sources at two places have equal delays in all channels but some.
_CHANCE, _COINCIDENCE = 1e-4, 3e-3

# Largest share of the stretches in which a sound channel has delays.
_SURE = 0.95

# A channel is silent rather than noisy below this level after the change, relative to
# its level before, dB.
_SILENT_DB = -40.0


@dataclass(frozen=True)
class ChannelDelays:
    """Delays of p pairs of n channels in s stretches of sound."""

    t_s: NDArray[np.float64]
    """(s,) middle of each stretch, s."""
    lags: NDArray[np.float64]
    """(s, p) delays of ``LagSearch.pairs``, s. NaN for pairs without common sound."""
    levels_db: NDArray[np.float64]
    """(s, n) levels of the channels, dB."""


def stretch_delays(
    stretch: NDArray[np.floating], search: LagSearch
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns (p,) delays in s, and (n,) levels in dB, of an (n, k) stretch."""
    levels = 10.0 * np.log10(np.maximum(np.var(stretch, axis=1), 1e-30))
    reach_s = _REACH_S + search.shape.max_delay(search.c)
    reach_s = min(reach_s, 0.5 * stretch.shape[1] / search.sample_rate_hz)
    return search.lags([stretch], reach_s), levels


def recorded_change(
    samples: NDArray[np.float64], search: LagSearch
) -> ChannelFault | None:
    """Finds channels of a whole (n, k) recording without NaN that change."""
    rate = search.sample_rate_hz
    seconds = samples.shape[1] / rate
    size = round(min(max(seconds / _STRETCHES, _STRETCH_S[0]), _STRETCH_S[1]) * rate)
    starts = np.arange(0, samples.shape[1] - size + 1, size)
    if len(starts) < 2 * _LEAST:
        return None
    starts = starts[:: -(-len(starts) // _MOST)]
    found = [stretch_delays(samples[:, k : k + size], search) for k in starts]
    lags, levels = (np.array(part) for part in zip(*found, strict=True))
    delays = ChannelDelays((starts + 0.5 * size) / rate, lags, levels)
    return (
        dying_channel(delays, search)
        or dying_channel(delays, search, backward=True)
        or slipping_channels(delays, search)
    )


def dying_channel(
    delays: ChannelDelays, search: LagSearch, *, backward: bool = False
) -> ChannelFault | None:
    """Finds a channel that has delays only before, or ``backward`` after, some time."""
    heard: NDArray[np.bool_] = np.isfinite(delays.lags)
    pairs = search.pairs
    for k in range(search.shape.count):
        own = np.any(pairs == k, axis=1)
        if not np.any(~own):
            continue
        others = np.flatnonzero(np.any(heard[:, ~own], axis=1))
        has = np.any(heard[others][:, own], axis=1)
        if backward:
            others, has = others[::-1], has[::-1]
        if not has.any():
            continue
        alive = has[: np.flatnonzero(has)[-1] + 1]
        share = min(float(alive.mean()), _SURE)
        gone = len(has) - len(alive)
        if len(alive) < _LEAST or gone < _LEAST or share < 0.5:
            continue
        if gone * math.log(1.0 - share) > math.log(_CHANCE):
            continue
        t_s = float(delays.t_s[others[len(alive) - 1 : len(alive) + 1]].mean())
        level = delays.levels_db[others, k]
        fall = np.median(level[len(alive) :]) - np.median(level[: len(alive)])
        what = "silent" if fall < _SILENT_DB else "without the sound in the others"
        when = f"until {t_s:.1f} s" if backward else f"from {t_s:.1f} s on"
        number = search.numbers[k]
        text = f"channel {number + 1}: dead, {what} {when}; check its microphone"
        return ChannelFault("dead", (number,), text)
    return None


def slipping_channels(delays: ChannelDelays, search: LagSearch) -> ChannelFault | None:
    """Finds channels whose delays all jump by the same amount at one time."""
    jumps = _jumps(delays.lags, search)
    if not jumps:
        return None
    jump = max(jumps, key=lambda jump: jump.significance)
    time_s = _time_of(jump, delays)
    if time_s is None:
        return None
    rate = search.sample_rate_hz
    step, channels = jump.step_s, [search.numbers[k] for k in jump.channels]
    samples = round(abs(step) * rate)
    what = "lost" if step < 0.0 else "repeated, or lost in the others"
    return ChannelFault(
        "slipped",
        tuple(channels),
        f"{channel_names(channels)}: {samples} sample{'s' * (samples > 1)} "
        f"({1e3 * abs(step):.3g} ms) {what} at {time_s:.1f} s; check "
        "the recorder, or use only the part before or after",
    )


def _time_of(jump: _Jump, delays: ChannelDelays) -> float | None:
    """Returns the time of a jump, s.

    It is None if the delays of the recording do not keep the values on either side.
    """
    lags = delays.lags[:, jump.across]
    heard = np.isfinite(lags).any(axis=1)
    lags, times = lags[heard], delays.t_s[heard]
    middle = 0.5 * (jump.before + jump.after)[jump.across]
    side = np.sign(jump.after - jump.before)[jump.across]
    near = min(0.5 * abs(jump.step_s), 0.25 * abs(jump.step_s) + _ROOM_S)
    is_after = known_medians((lags - middle) * side, axis=1) > 0.0
    # The best split has the most stretches on the right sides.
    wrong = np.cumsum(np.where(is_after, 1, -1))
    if len(lags) < 2 * _LEAST:
        return None
    k = int(np.argmin(wrong[:-1]))
    off = np.where(
        np.arange(len(lags))[:, np.newaxis] > k,
        lags - jump.after[jump.across],
        lags - jump.before[jump.across],
    )
    kept = known_medians(np.abs(off), axis=1) < near
    if min(kept[: k + 1].mean(), kept[k + 1 :].mean()) < _KEPT:
        return None
    return 0.5 * float(times[k] + times[k + 1])


class _Jump(NamedTuple):
    channels: list[int]
    step_s: float
    significance: float
    before: NDArray[np.float64]
    """(p,) delays before the jump, s."""
    after: NDArray[np.float64]
    across: NDArray[np.bool_]
    """(p,) whether a pair jumps."""


def _jumps(lags: NDArray[np.float64], search: LagSearch) -> list[_Jump]:
    """Returns the jumps of (s, p) delays that are faults, each with its neighbors."""
    rate, count = search.sample_rate_hz, search.shape.count
    if count < 3:
        return []
    splits = slice(_LEAST, len(lags) - _LEAST + 1)
    before, std_before = (x[::-1][splits] for x in _next_medians(lags[::-1], rate))
    after, std_after = (x[splits] for x in _next_medians(lags, rate))
    change, std = after - before, np.hypot(std_before, std_after)
    known = np.isfinite(change)
    size = np.max(np.abs(change), axis=1, keepdims=True, initial=0.0, where=known)
    error = np.minimum(_SHARE * size, _STILL * search.allowed_s) + _WITHIN * std
    stays = known & (np.abs(change) <= error)
    first, two = _two_groups(stays, search.pairs, count)
    found = (
        _jump_between(before[k], after[k], std[k], error[k], first[k], search)
        for k in np.flatnonzero(two & (size[:, 0] >= _LEAST_SAMPLES / rate))
    )
    return [jump for jump in found if jump is not None]


def _two_groups(
    joined: NDArray[np.bool_], pairs: NDArray[np.intp], count: int
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Returns the group of channel 0, and whether there is exactly one other group.

    In each of s rows, (s, p) ``joined`` pairs of channels are in the same group. The
    results have the shapes (s, n) and (s,).
    """
    reached = np.tile(np.eye(count, dtype=np.float32), (len(joined), 1, 1))
    i, j = pairs.T
    reached[:, i, j] = reached[:, j, i] = joined
    # Each product doubles the length of the paths through joined pairs.
    for _ in range(math.ceil(math.log2(count))):
        reached = np.minimum(reached @ reached, 1.0)
    same = reached > 0.0
    first = same[:, 0]
    others = np.where(
        first[:, :, np.newaxis], first[:, np.newaxis], ~first[:, np.newaxis]
    )
    return first, np.all(same == others, axis=(1, 2)) & ~first.all(axis=1)


def _jump_between(
    before: NDArray[np.float64],
    after: NDArray[np.float64],
    std: NDArray[np.float64],
    error: NDArray[np.float64],
    first: NDArray[np.bool_],
    search: LagSearch,
) -> _Jump | None:
    """Returns the jump between (p,) delays before and after it, if it is a fault.

    The (n,) channels ``first`` keep their delays among themselves, and so do the
    others.
    """
    rate, pairs, count = search.sample_rate_hz, search.pairs, search.shape.count
    change = after - before
    known = np.isfinite(change)
    stays = known & (np.abs(change) <= error)
    i, j = pairs.T
    # Changes of the second group against the first one.
    across = known & (first[i] != first[j])
    inside = np.abs(before) <= search.allowed_s
    if not across.any() or not np.all(inside[across]):
        # The channel was late before, or it heard an echo.
        return None
    steps = np.where(first[i], change, -change)[across]
    step = float(np.median(steps))
    samples = abs(step) * rate
    whole = samples > _FEW or abs(samples - round(samples)) < _OFF_WHOLE
    significance = abs(step) / float(np.median(std[across]))
    alike = np.all(np.abs(steps - step) <= error[across])
    within = known & (first[i] == first[j])
    still = within.any() and np.all(stays[within])
    # Some path of a near source explains any possible delays of three channels.
    moved = count == 3 and np.all(np.abs(after[across]) <= search.allowed_s[across])
    if moved or not (alike and still and whole) or significance < _DEVIATIONS:
        return None
    # A source that moves leaves the delays of the other channels by chance only.
    chance = float(np.median((error / search.allowed_s)[within])) ** (count - 2)
    wave = _wave_explains(before, after, known, float(np.median(error[across])), search)
    if wave and chance > _COINCIDENCE:
        return None
    # The smaller group jumps. Of equal groups, the one that becomes early lost samples.
    second = first.sum() > count / 2 or (2 * first.sum() == count and step < 0.0)
    channels = np.flatnonzero(~first if second else first).tolist()
    step = step if second else -step
    return _Jump(channels, step, significance, before, after, across)


def _next_medians(
    lags: NDArray[np.float64], rate: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns (s + 1, p) medians of the next delays of each pair, and their errors, s.

    Row k contains those of the first delays from stretch k on.
    """
    heard: NDArray[np.bool_] = np.isfinite(lags)
    # The delays of each pair, without gaps, and then NaN.
    packed = np.take_along_axis(lags, np.argsort(~heard, axis=0, kind="stable"), axis=0)
    packed = np.pad(packed, ((0, _MANY), (0, 0)), constant_values=np.nan)
    skipped = np.pad(np.cumsum(heard, axis=0), ((1, 0), (0, 0)))
    number = np.minimum(heard.sum(axis=0) - skipped, _MANY)
    following = sliding_window_view(packed, _MANY, axis=0)
    following = following[skipped, np.arange(lags.shape[1])]
    middles = known_medians(following)
    scatter = known_medians(np.abs(following - middles[:, :, np.newaxis]))
    # The error of a median of n values is 1.25 times that of their mean.
    errors = 1.25 * np.maximum(1.4826 * scatter, _FLOOR_SAMPLES / rate)
    errors /= np.sqrt(np.maximum(number, 1))
    enough = number >= _LEAST
    return np.where(enough, middles, np.nan), np.where(enough, errors, np.nan)


def _wave_explains(
    before: NDArray[np.float64],
    after: NDArray[np.float64],
    known: NDArray[np.bool_],
    error: float,
    search: LagSearch,
) -> bool:
    """Returns whether a far source that moves explains the change of the delays."""
    p_AM = search.shape.p_AM
    i, j = search.pairs[known].T
    paths = p_AM[i] - p_AM[j]
    inverse = np.linalg.pinv(paths, rcond=1e-3)
    change = (after - before)[known]
    off = change - paths @ (inverse @ change)
    first, last = (
        float(np.linalg.norm(inverse @ lags[known])) * search.c
        for lags in (before, after)
    )
    # Wave fronts from near sources are curved.
    a = search.shape.aperture_m
    error += a**2 / (8.0 * max(a, _NEAR_M) * search.c)
    # An array in space measures the speed of sound, which does not change.
    changed = search.shape.kind == "space" and abs(last - first) > _SLOWEST - 1.0
    return float(np.abs(off).max()) < error and last < _SLOWEST and not changed
