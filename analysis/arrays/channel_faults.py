"""Finds faulty channels of a recording, which would otherwise cause wrong positions.

There are these checks:

- Each channel alone: whether it has NaN values, is constant, or is clipped.
- Pairs of channels: whether one is a copy of the other
  (``analysis.arrays.copied_microphones``).
- Each channel compared with the others: its level, its alignment in time
  (``analysis.arrays.channel_timing``), the height of its correlation with them
  (``analysis.arrays.shared_sound``), and the sign of this correlation.
- The delays of all channels: whether they match the size of the array, and whether
  they fit a position of a source (``analysis.arrays.geometry_faults``).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.array_geometry import (
    HIGHEST_FAULTS_HZ,
    KnownArray,
    usable_band,
)
from analysis.arrays.channel_fault import ChannelFault, FaultKind, channel_names
from analysis.arrays.channel_timing import LagSearch, LateChannels, unaligned_channels
from analysis.arrays.copied_microphones import copied_microphones
from analysis.arrays.frame_delays import REACHES_M, FrameDelays
from analysis.arrays.geometry_faults import geometry_faults
from analysis.arrays.pair_correlations import PairCorrelations, correlate_pairs
from analysis.arrays.shared_sound import COHERENT, strangers

# _DEAD_DB: a channel is dead if it is more than this below the second loudest of the
#   others, dB.
# _NEAR_DB: the source is near a channel that is more than this above the median of the
#   others, dB.
# _GAIN_DEVIATIONS: limit with the same meaning as _NEAR_DB, in standard deviations of
#   the gain. The larger of the two limits applies.
_DEAD_DB = 30.0
_NEAR_DB = 15.0
_GAIN_DEVIATIONS = 5.0

# Omnidirectional microphones with equal gains hear a distant source at equal levels.
# Directional microphones are likely if the levels differ by more than a number of
# standard deviations of the gain: levels of inverted or late channels from those of the
# others, and the highest from the lowest level. Distances cause differences as well,
# so the standard deviation counts as at least _LEAST_GAIN_DB.
_DIFFERS, _SPREAD, _LEAST_GAIN_DB = 1.5, 4.0, 2.0

# A microphone that points away from the source may hear an echo instead of the direct
# sound. The strongest echo arrives within this time, s.
_ECHO_S = 0.03

_OR_WIRES = (
    "directional microphones? Use omnidirectional ones, or exchange the wires of these"
)

# _LEAST_PILE: least number of samples of a clipped channel at an extreme value.
# _CLIPPED_SHARE: least share of the samples of a clipped channel at an extreme value.
# _PILE: how many times more often the extreme value occurs than each of the next three
#   values. For a sine, the factor is 2.4.
_LEAST_PILE = 5
_CLIPPED_SHARE = 1e-4
_PILE = 4.0

# Least difference between the positive and the negative peak of a correlation, as a
# share of the sum of both.
_LEAD = 0.1


def find_channel_faults(
    samples: NDArray[np.float64],
    array: KnownArray,
    *,
    sample_rate_hz: float,
    band_hz: tuple[float, float] | None = None,
    omitted: Sequence[int] = (),
) -> list[ChannelFault]:
    """Finds the faults of the (n, samples) channels of a recording.

    An empty list does not prove that all channels are good, because a silent recording
    shows few faults. The channels ``omitted`` are not examined. If ``band_hz`` is None,
    the band is 300 Hz up to 8000 Hz or 0.45 times the sample rate, whichever is lower.
    """
    shape, c = array.shape, array.c
    examined = [k for k in range(len(samples)) if k not in omitted]
    found = [f for k in examined if (f := _unreadable(k, samples[k])) is not None]
    unread = {k for fault in found for k in fault.channels}
    use = np.array([k for k in examined if k not in unread], dtype=int)
    found += [fault for k in use if (fault := _clipped(int(k), samples[k])) is not None]
    if use.size < 2:
        return found
    readable = samples if use.size == len(samples) else samples[use]
    found += _copied(readable, use, sample_rate_hz, array)
    # Levels at distant recorders differ, and a call reaches only some of them.
    if array.far_apart:
        return found
    band_hz = usable_band(band_hz, sample_rate_hz, highest_hz=HIGHEST_FAULTS_HZ)
    measured = correlate_pairs(readable, shape.max_delay(c), sample_rate_hz, band_hz)
    if measured is None:
        return found
    found += _levels(measured, use, array.gain_std_db)
    dead = {k for fault in found if fault.kind == "dead" for k in fault.channels}
    heard = np.array([k for k in range(use.size) if int(use[k]) not in dead])
    if heard.size > 2:
        search = LagSearch.of(array, sample_rate_hz, band_hz, use[heard].tolist())
        late = unaligned_channels(readable[heard], search)
        if late is not None:
            return [*found, _late_or_echo(late, measured, use, array.gain_std_db)]
    found += strangers(measured, use, shape)
    dead = {k for fault in found if fault.kind == "dead" for k in fault.channels}
    inverted = _inverted(measured, use, dead, array.gain_std_db)
    found += inverted
    if use.size < shape.count or dead or any(f.kind == "near" for f in found):
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

    def farther() -> list[FrameDelays]:
        seen = [
            correlate_pairs(readable, reach_m / c, sample_rate_hz, band_hz)
            for reach_m in REACHES_M
        ]
        return [delays(each) for each in seen if each is not None]

    of_geometry = geometry_faults(delays(measured), c, farther)
    if any(fault.kind == "units" for fault in of_geometry):
        # Signs were looked for at delays of another array.
        found = [fault for fault in found if fault not in inverted]
    return found + _not_of_directivity(of_geometry, measured, array.gain_std_db)


def _of_channel(kind: FaultKind, k: int, text: str) -> ChannelFault:
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
    samples: NDArray[np.float64],
    use: NDArray[np.int64],
    sample_rate_hz: float,
    array: KnownArray,
) -> list[ChannelFault]:
    faults = []
    places = array.shape.p_AM[use]
    for pair in copied_microphones(samples, sample_rate_hz, places, array.c):
        i, j = use[list(pair)].tolist()
        text = (
            f"channels {i + 1} and {j + 1}: their samples are equal apart from gain "
            "and delay; record every microphone on its own channel, or add noise to "
            "a simulation"
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


def _inverted(
    measured: PairCorrelations,
    use: NDArray[np.int64],
    dead: set[int],
    gain_std_db: float,
) -> list[ChannelFault]:
    """Finds channels that have negative correlations with most other channels."""
    high, low = measured.pooled_highest, -measured.pooled_lowest
    heard = np.maximum(high, low) > COHERENT * measured.noise
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
    louder = _louder_db(measured, negative) if negative.size else 0.0
    if abs(louder) > _DIFFERS * max(gain_std_db, _LEAST_GAIN_DB):
        channels = use[negative].tolist()
        seen = f"inverted, and {_louder(louder)} than the others"
        text = f"{channel_names(channels)}: {seen}; {_OR_WIRES}"
        return [ChannelFault("directional", tuple(channels), text)]
    return [_of_channel("inverted", int(use[k]), text) for k in negative]


def _louder_db(measured: PairCorrelations, chosen: NDArray[np.int64]) -> float:
    """Returns the mean level of the chosen channels relative to the others, dB."""
    level = 20.0 * np.log10(np.maximum(measured.level, 1e-300))
    return float(level[chosen].mean() - np.delete(level, chosen).mean())


def _louder(by_db: float) -> str:
    return f"{abs(by_db):.0f} dB {'louder' if by_db > 0.0 else 'fainter'}"


def _late_or_echo(
    late: LateChannels,
    measured: PairCorrelations,
    use: NDArray[np.int64],
    gain_std_db: float,
) -> ChannelFault:
    """Adds another cause to a fault of late channels if these are also fainter."""
    louder = _louder_db(measured, np.flatnonzero(np.isin(use, late.channels)))
    differs = abs(louder) > _DIFFERS * max(gain_std_db, _LEAST_GAIN_DB)
    if not differs or late.seconds > _ECHO_S:
        return late
    seen, _, remedy = late.message.partition("; ")
    cause = "directional microphones that hear an echo? If not,"
    text = f"{seen}, and {_louder(louder)}; {cause} {remedy}"
    return ChannelFault("directional", (), text)


def _not_of_directivity(
    faults: list[ChannelFault], measured: PairCorrelations, gain_std_db: float
) -> list[ChannelFault]:
    """Replaces faults of the geometry if unequal levels have another explanation."""
    spread = float(np.ptp(20.0 * np.log10(np.maximum(measured.level, 1e-300))))
    if spread < _SPREAD * max(gain_std_db, _LEAST_GAIN_DB):
        return faults
    text = (
        f"recording: the delays fit no source, and the levels differ by {spread:.0f} "
        "dB; directional microphones? Use omnidirectional ones, or check the positions"
    )
    return [
        ChannelFault("directional", (), text)
        if fault.kind in ("units", "geometry")
        else fault
        for fault in faults
    ]


def _lags(
    measured: PairCorrelations, signs: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Returns (f, p) delays of all pairs, samples, corrected for inverted channels."""
    i, j = measured.pairs.T
    upright = signs[i] * signs[j] > 0.0
    return np.where(upright, measured.lag_of_highest, measured.lag_of_lowest)
