"""Finds faulty channels of a recording, which would otherwise cause wrong positions.

There are these checks:

- Each channel alone: whether it has NaN values, is constant, or is clipped.
- Pairs of channels: whether one is a copy of the other
  (``systems.delays.copied_channels``).
- Each channel compared with the others: its level, and the height and the sign of its
  correlation with them.
- The delays of all channels: whether they match the size of the array, and whether
  they fit a position of a source (``analysis.arrays.frame_delays``).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.array_geometry import (
    HIGHEST_FAULTS_HZ,
    KnownArray,
    usable_band,
)
from analysis.arrays.frame_delays import (
    REACHES_M,
    DelayScale,
    FrameDelays,
    delay_scale,
    exchanged_channels,
    misfit,
)
from analysis.arrays.pair_correlations import PairCorrelations, correlate_pairs
from systems.delays.copied_channels import copied_pairs
from systems.sound.array_shape import ArrayShape

# _DEAD_DB: a channel is dead if it is more than this below the second loudest of the
#   others, dB.
# _NEAR_DB: the source is near a channel that is more than this above the median of the
#   others, dB.
# _GAIN_DEVIATIONS: limit with the same meaning as _NEAR_DB, in standard deviations of
#   the gain. The larger of the two limits applies.
_DEAD_DB = 30.0
_NEAR_DB = 15.0
_GAIN_DEVIATIONS = 5.0

# _LEAST_PILE: least number of samples of a clipped channel at an extreme value.
# _CLIPPED_SHARE: least share of the samples of a clipped channel at an extreme value.
# _PILE: how many times more often the extreme value occurs than each of the next three
#   values. For a sine, the factor is 2.4.
_LEAST_PILE = 5
_CLIPPED_SHARE = 1e-4
_PILE = 4.0

# Limits of a correlation, as multiples of the correlation of noise. Above _COHERENT,
# two channels share a sound. Below _INCOHERENT, they share nothing.
_COHERENT, _INCOHERENT = 5.0, 2.5

# Least number of frames that must agree. Fewer frames may agree by chance, for example
# in a recording with few long frames.
_LEAST_FRAMES = 16

# Delays that are too long by more than this factor mean wrong units of the positions.
# Up to this factor, they mean wrong positions or wrongly ordered channels.
_OTHER_UNITS = 3.5

# Largest plausible distance of a source straight above the array, m.
_FARTHEST_M = 20.0

# Least difference between the positive and the negative peak of a correlation, as a
# share of the sum of both.
_LEAD = 0.1


_Kind = Literal[
    "nan", "dead", "copied", "clipped", "inverted", "swapped", "near", "geometry",
    "units", "size", "late", "drift"
]  # fmt: skip


@dataclass(frozen=True)
class ChannelFault:
    """A fault of one or more channels, or of the description of the array."""

    kind: _Kind
    channels: tuple[int, ...]
    """Numbers of the faulty channels, from 0. Empty if the fault concerns all channels.
    """
    message: str
    """One line with the observation and the remedy. It counts channels from 1."""


def find_channel_faults(
    samples: NDArray[np.float64],
    array: KnownArray,
    *,
    sample_rate_hz: float,
    band_hz: tuple[float, float] | None = None,
) -> list[ChannelFault]:
    """Finds the faults of the (n, samples) channels of a recording.

    An empty list does not prove that all channels are good, because a silent recording
    shows few faults. If ``band_hz`` is None, the band is 300 Hz up to 8000 Hz or 0.45
    times the sample rate, whichever is lower.
    """
    shape, c = array.shape, array.c
    faults = [_unreadable(k, channel) for k, channel in enumerate(samples)]
    found = [fault for fault in faults if fault is not None]
    use = np.array([k for k, fault in enumerate(faults) if fault is None], dtype=int)
    found += [fault for k in use if (fault := _clipped(int(k), samples[k])) is not None]
    if use.size < 2:
        return found
    readable = samples if use.size == len(samples) else samples[use]
    found += _copied(readable, use, sample_rate_hz)
    band_hz = usable_band(band_hz, sample_rate_hz, highest_hz=HIGHEST_FAULTS_HZ)
    measured = correlate_pairs(readable, shape.max_delay(c), sample_rate_hz, band_hz)
    if measured is None:
        return found
    beside = _levels(measured, use, array.gain_std_db) + _strangers(measured, use)
    dead = {k for fault in beside if fault.kind == "dead" for k in fault.channels}
    found += beside
    inverted = _inverted(measured, use, dead)
    found += inverted
    if use.size < shape.count or dead or any(f.kind == "near" for f in beside):
        return found
    signs = np.ones(shape.count)
    signs[[k for fault in inverted for k in fault.channels]] = -1.0

    def delays(measured: PairCorrelations) -> FrameDelays:
        return FrameDelays(
            _lags(measured, signs),
            measured.levels,
            shape,
            c / sample_rate_hz,
            position_std_m=array.misplaced_m,
            gain_std_db=array.gain_std_db,
        )

    as_given = delays(measured)
    order = _order(as_given)
    if any(fault.kind == "swapped" for fault in order):
        return found + order
    scale = delay_scale(as_given)
    if not _fits(as_given):
        for reach_m in REACHES_M:
            seen = correlate_pairs(readable, reach_m / c, sample_rate_hz, band_hz)
            if seen is not None and scale is None:
                scale = delay_scale(delays(seen))
    return found + (order if scale is None else [_scale_fault(scale, shape)])


def _of_channel(kind: _Kind, k: int, text: str) -> ChannelFault:
    return ChannelFault(kind, (k,), f"channel {k + 1}: {text}")


def _dead(k: int, seen: str) -> ChannelFault:
    remedy = "check its microphone, or leave it out of the geometry"
    return _of_channel("dead", k, f"dead, {seen}; {remedy}")


def _unreadable(k: int, channel: NDArray[np.float64]) -> ChannelFault | None:
    wrong = np.flatnonzero(~np.isfinite(channel))
    if wrong.size:
        text = f"sample {wrong[0]} is not a number ({wrong.size} samples in all)"
        return _of_channel("nan", k, f"{text}; repair the file")
    if channel.size and np.ptp(channel) == 0.0:
        return _dead(k, f"all samples are {channel[0]:g}")
    return None


def _copied(
    samples: NDArray[np.float64], use: NDArray[np.int64], sample_rate_hz: float
) -> list[ChannelFault]:
    faults = []
    for pair in copied_pairs(samples, sample_rate_hz):
        i, j = use[list(pair)].tolist()
        text = (
            f"channels {i + 1} and {j + 1}: their samples are equal apart from gain "
            "and delay; record every microphone on its own channel"
        )
        faults.append(ChannelFault("copied", (i, j), text))
    return faults


def _clipped(k: int, channel: NDArray[np.float64]) -> ChannelFault | None:
    """Reports a channel with far more samples at its extremes than just inside them."""
    _, counts = np.unique(channel, return_counts=True)
    most = 0
    for ends in (counts, counts[::-1]):
        if ends[0] >= _LEAST_PILE and ends[0] > _PILE * ends[1:4].max(initial=0):
            most += int(ends[0])
    share = most / channel.size
    if share < _CLIPPED_SHARE:
        return None
    text = f"clipped, {100 * share:.2g} % of its samples are at an extreme"
    return _of_channel("clipped", k, f"{text}; record with less gain")


def _levels(
    measured: PairCorrelations, use: NDArray[np.int64], gain_std_db: float
) -> list[ChannelFault]:
    """Finds channels whose level is far below or above the level of the others."""
    near_db = max(_NEAR_DB, _GAIN_DEVIATIONS * gain_std_db)
    level = 20.0 * np.log10(np.maximum(measured.level, 1e-300))
    faults = []
    for k, channel in enumerate(use.tolist()):
        others = np.sort(np.delete(level, k))
        over = float(level[k] - np.median(others))
        # The loudest of the others does not count, because the source may be at its
        # microphone.
        if level[k] - others[max(-2, -others.size)] < -_DEAD_DB:
            faults.append(_dead(channel, f"{-over:.0f} dB below the others"))
        # The source is near one microphone if the levels of all other channels are
        # similar.
        if over > near_db and np.ptp(others) < near_db:
            text = (
                f"{over:.0f} dB above the others: the source is close to its "
                "microphone, or gains differ; move the source away from the array, or "
                "set equal gains"
            )
            faults.append(_of_channel("near", channel, text))
    return faults


def _strangers(
    measured: PairCorrelations, use: NDArray[np.int64]
) -> list[ChannelFault]:
    """Finds channels that have no sound in common with the others."""
    table = np.zeros((use.size, use.size))
    table[tuple(measured.pairs.T)] = measured.shared
    best = (table + table.T).max(axis=0)
    if use.size < 3 or best.max() < _COHERENT:
        return []
    return [
        _dead(channel, "it has nothing in common with the sound in the others")
        for k, channel in enumerate(use.tolist())
        if best[k] < _INCOHERENT
    ]


def _inverted(
    measured: PairCorrelations, use: NDArray[np.int64], dead: set[int]
) -> list[ChannelFault]:
    """Finds channels that have negative correlations with most other channels."""
    high, low = measured.pooled_highest, -measured.pooled_lowest
    heard = np.maximum(high, low) > _COHERENT * measured.noise
    table = np.zeros((use.size, use.size))
    table[tuple(measured.pairs.T)] = np.where(heard, (high - low) / (high + low), 0.0)
    table += table.T
    alive = np.array([k not in dead for k in use.tolist()])
    signs = np.sign(np.linalg.eigh(table)[1][:, -1])
    signs[signs == 0.0] = 1.0
    if np.sum(signs * alive) < 0.0:
        signs = -signs
    # After the signs are corrected, each channel must agree with the others on average.
    agreement = signs * (table @ (signs * alive)) / max(alive.sum() - 1, 1)
    if np.any(agreement[alive] < _LEAD):
        return []
    text = (
        "inverted, because its correlation with the others is negative; exchange the "
        "wires of its microphone, or the sign of its samples"
    )
    # The sign of a channel without any sound in common with the others is arbitrary.
    negative = np.flatnonzero((signs < 0.0) & alive & (table @ alive < 0.0))
    return [_of_channel("inverted", int(use[k]), text) for k in negative]


def _lags(
    measured: PairCorrelations, signs: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Returns (f, p) delays of all pairs, samples, corrected for inverted channels."""
    i, j = measured.pairs.T
    upright = signs[i] * signs[j] > 0.0
    return np.where(upright, measured.lag_of_highest, measured.lag_of_lowest)


def _fits(delays: FrameDelays) -> bool:
    agreed, _ = delays.agreeing()
    return len(agreed) >= max(_LEAST_FRAMES, len(delays.lags) / 2)


def _scale_fault(scale: DelayScale, shape: ArrayShape) -> ChannelFault:
    size = f"an array of {shape.aperture_m:.3g} m"
    if scale.kind == "beyond":
        remedy = "check the positions (in m) and the order of the channels"
        if scale.share > _OTHER_UNITS:
            remedy = "give positions in m (multiply them by 10, 100 or 1000?)"
        times = f"{scale.share:.1f} times as long as sound takes along it"
        text = f"microphones: {size} cannot have delays {times}; {remedy}"
        return ChannelFault("units", (), text)
    said = f"delays are below {100 * scale.share:.1g} % of what {size} can have"
    if shape.kind == "space" or scale.least_range_m > _FARTHEST_M:
        remedy = "give positions in m (divide those in cm by 100, in mm by 1000)"
        return ChannelFault("units", (), f"microphones: {said}; {remedy}")
    where = "ahead of" if shape.kind == "row" else "above or below"
    cause = f"the source is straight {where} it, or the positions are not in m"
    text = f"microphones: {said}: {cause}; check the positions"
    return ChannelFault("size", (), text)


def _order(delays: FrameDelays) -> list[ChannelFault]:
    """Finds exchanged channels, or a geometry that the delays do not fit."""
    exchanges = exchanged_channels(delays)
    if exchanges:
        names = " or ".join(f"{a + 1} and {b + 1}" for a, b in exchanges)
        text = (
            f"channels {names}: exchanged, because the delays fit the geometry only in "
            "the other order; exchange them in 'channels'"
        )
        channels = tuple(sorted({k for pair in exchanges for k in pair}))
        return [ChannelFault("swapped", channels, text)]
    share = misfit(delays)
    if share is None:
        return []
    text = (
        f"channels: {100 * share:.0f} % of the delays fit no place outside the array; "
        "check the microphones' positions (in m), their order and the speed of sound, "
        "and state the 'body' if the microphones are on a sphere"
    )
    return [ChannelFault("geometry", (), text)]
