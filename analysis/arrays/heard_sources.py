"""Finds all sources in a recording, their directions, and their tracks over time.

In steady sound, no time or frequency contains only one source. The level of a steady
sound in a narrow band scatters like that of Gaussian noise. For the four windows of a
vote, the scatter is 3.1 dB. It is smaller if several sources or echoes reach the
microphones. The level of speech and other changing sounds scatters by 5 dB or more,
even in reverberant rooms.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.voting.direction_votes import VotePlan, cast_votes
from analysis.arrays.voting.source_listener import (
    ListenerParameters,
    are_unfit,
    follow_sources,
)
from analysis.arrays.voting.track_state import SourceTrack
from analysis.arrays.voting.vote_bearings import wrapped
from analysis.arrays.voting.vote_peaks import VotedSource, gather_sources
from analysis.arrays.voting.vote_records import DirectionVotes, join_votes
from systems.sound.array_shape import ArrayShape

#: Reasons for which votes need estimates. If microphones are far apart, the steered
#: response has side lobes. Between short sounds, only their echoes vote.
SIDE_LOBES = "directions may be side lobes of a wide array"
ECHOES = "directions may be echoes of short sounds"

# Samples per channel in each block of votes.
_BLOCK = 2**16

# Longest pause of a source within a track, s. After a longer pause, its direction is
# only a guess.
_PAUSE_S = 0.3

# _MOVES_DEG: a source moves if its track turns by more than this, deg.
# _NEAR_DEG: directions within this of each other count as equal, deg.
_MOVES_DEG, _NEAR_DEG = 20.0, 8.0

# Largest overlap in time of two directions of one moving source, as a share of the
# shorter of the two spans of time.
_TOGETHER = 0.25

# Largest confidence of a source or track in steady sound.
_NOT_TOLD = 0.5

# Largest scatter of the level of steady sound, dB. The value is halfway between noise
# and speech.
_STEADY_DB = 4.4

# Largest mean of how far the votes of a steady source stand out from the steady level.
# It is about 0.01 for a fan beside a talker, and 0.8 for the talker.
_STEADY_RISES = 0.25

# A group of frames counts as sounding if its level is within _SOUNDS_DB of the quantile
# _LOUD_SHARE of all levels. The sound must last at least _LEAST_S, s.
_SOUNDS_DB, _LOUD_SHARE = 10.0, 0.9
_LEAST_S = 0.5

# Quantile of the scatter over the bands. If there is noise, only some bands contain the
# source.
_OF_BANDS = 0.75


@dataclass(frozen=True)
class HeardSource:
    """A direction from which sound came, over the whole recording."""

    bearing_deg: float
    """Azimuth from the centroid of the microphones, CCW from +x, in (-180, 180], deg.
    """
    bearing_std_deg: float
    """Standard deviation of the bearing, deg."""
    elevation_deg: float | None
    """Elevation from the x-y plane, deg. None if the array cannot measure it."""
    elevation_std_deg: float | None
    """Standard deviation of the elevation, deg."""
    share: float
    """Share of the source in the A-weighted power of all sources, 0 to 1."""
    confidence: float
    """Confidence that the source exists, 0 to 1."""

    @classmethod
    def of(cls, voted: VotedSource, power: float) -> HeardSource:
        """Makes a source from a peak of the votes, and the power of all sources."""
        return cls(
            bearing_deg=math.degrees(voted.bearing),
            bearing_std_deg=math.degrees(voted.bearing_std),
            elevation_deg=_degrees(voted.elevation),
            elevation_std_deg=_degrees(voted.elevation_std),
            share=voted.power / power if power > 0.0 else voted.share,
            confidence=voted.confidence,
        )


@dataclass(frozen=True)
class FollowedSource:
    """Track of a source over some time."""

    identity: int
    """Number of the source, from 1, in the order in which the sources began."""
    t_s: list[float]
    """Times of the bearings, s from the start of the recording."""
    bearing_deg: list[float]
    """Bearing of the source at each time, deg."""
    confidence: float
    """Greatest probability during the track that the source existed, 0 to 1."""


@dataclass(frozen=True)
class HeardSources:
    """All sources and tracks in a recording."""

    sources: list[HeardSource] = field(default_factory=list)
    """The sources. The loudest source is first."""
    tracks: list[FollowedSource] = field(default_factory=list)
    """The tracks, in the order of their beginnings."""
    steady: bool = False
    """Whether the sound is steady. The direction of most of a steady sound is known,
    but the number of its sources is unknown. No confidence then exceeds 0.5."""
    beside_steady: bool = False
    """Whether one of several sources is steady, such as a fan beside a talker. The
    confidence of the steady source is then at most 0.5."""
    unfit: bool = False
    """Whether the phases are not those of sound from far away at this array. The
    directions may then be wrong."""
    needs_estimates: str | None = None
    """Why a source of the votes may be none if no estimate confirms it. None if votes
    suffice."""


_Told = TypeVar("_Told", HeardSource, FollowedSource)


def heard_sources(
    channels: NDArray[np.float32],
    shape: ArrayShape,
    c: float,
    sample_rate_hz: float,
    band_hz: tuple[float, float],
) -> HeardSources:
    """Finds all sources that stand out in (n, samples) channels, and their tracks.

    The result is empty if the array cannot measure bearings.
    """
    if "bearing" not in shape.angles:
        return HeardSources()
    plan = VotePlan.of(shape, c, sample_rate_hz, band_hz=band_hz)
    memory, parts = plan.blank(), []
    for first in range(0, channels.shape[1], _BLOCK):
        votes, memory = cast_votes(plan, memory, channels[:, first : first + _BLOCK])
        parts.append(votes)
    votes = join_votes(parts)
    steady = is_steady(votes)
    if steady:
        votes = steered_only(votes)
    found = gather_sources(votes)
    # A fan may have most votes, but little weight beside a talker.
    found += [
        voted
        for voted in gather_sources(votes, by_level=False)
        if _is_fan(voted, votes) and not _is_known(voted, found)
    ]
    power = sum(voted.power for voted in found)
    found.sort(key=lambda voted: -voted.power)
    told = [
        (HeardSource.of(voted, power), not steady and _is_fan(voted, votes))
        for voted in found
    ]
    sources = [_doubted(source) if fan else source for source, fan in told]
    tracks = _tracks(votes, channels.shape[1] / sample_rate_hz, plan)
    sources = _counted_once(sources, tracks, votes)
    if steady:
        sources = [_doubted(source) for source in sources[:1]]
        tracks = [_doubted(track) for track in tracks]
    return HeardSources(
        sources,
        tracks,
        steady,
        beside_steady=any(fan for _, fan in told),
        unfit=is_unfit(votes),
        needs_estimates=SIDE_LOBES if plan.bins.start == plan.bins.stop else None,
    )


def is_unfit(votes: DirectionVotes) -> bool:
    """Returns whether the phases are not those of sound from far away at the array."""
    return are_unfit(votes.group_fits.sum(axis=0))


def _is_known(voted: VotedSource, found: list[VotedSource]) -> bool:
    near = math.radians(2.0 * _NEAR_DEG)
    return any(abs(wrapped(voted.bearing - one.bearing)) < near for one in found)


def _is_fan(voted: VotedSource, votes: DirectionVotes) -> bool:
    """Returns whether a source is steady; of a short recording that is unknown."""
    lasts_s = float(np.ptp(votes.group_t_s)) if votes.group_t_s.size else 0.0
    return voted.rises < _STEADY_RISES and lasts_s >= _LEAST_S


def _degrees(angle: float | None) -> float | None:
    return None if angle is None else math.degrees(angle)


def is_steady(votes: DirectionVotes) -> bool:
    """Returns whether a sound is so steady that its sources cannot be separated.

    The steadiness of a sound of less than 0.5 s is unknown, and the result is False.
    """
    scatter = level_scatter_db(votes)
    return scatter is not None and scatter < _STEADY_DB


def level_scatter_db(votes: DirectionVotes) -> float | None:
    """Computes how much the level in narrow bands scatters while there is sound, dB.

    A quarter of the bands exceed the result. It is None for a sound of less than 0.5 s.
    """
    levels, t_s = votes.group_levels_db, votes.group_t_s
    if len(levels) < 2:
        return None
    loud = levels[_sounds(levels)]
    if len(loud) * float(t_s[1] - t_s[0]) < _LEAST_S:
        return None
    return float(np.quantile(loud.std(axis=0), _OF_BANDS))


def steered_only(votes: DirectionVotes) -> DirectionVotes:
    """Removes the votes of single frequencies, and keeps those of the steered response.

    If several steady sources sound together, single frequencies vote for directions
    between the sources. The steered response measures how well all frequencies together
    agree on a direction.
    """
    return votes.part(votes.steered, slice(None))


def _sounds(levels_db: NDArray[np.float64]) -> NDArray[np.bool_]:
    whole = 10.0 * np.log10(np.sum(10.0 ** (0.1 * levels_db), axis=1))
    return np.asarray(whole >= np.quantile(whole, _LOUD_SHARE) - _SOUNDS_DB)


def _counted_once(
    sources: list[HeardSource], tracks: list[FollowedSource], votes: DirectionVotes
) -> list[HeardSource]:
    """Removes directions that a moving source only passed on its way.

    A direction is removed if the track of a moving source passes this direction and
    another direction in the list. The two directions must hardly ever be heard at the
    same time.
    """
    moving = [track for track in tracks if _extent_deg(track) > _MOVES_DEG]
    kept: list[HeardSource] = []
    for source in sources:
        passing = [track for track in moving if _passes(track, source)]
        known = any(
            _passes(track, other) and _apart_in_time(votes, source, other)
            for track in passing
            for other in kept
        )
        if not known:
            kept.append(source)
    return kept


def _apart_in_time(votes: DirectionVotes, *sources: HeardSource) -> bool:
    spans = []
    for source in sources:
        off = np.degrees(votes.azimuth) - source.bearing_deg
        near = np.abs((off + 180.0) % 360.0 - 180.0) < _NEAR_DEG
        spans.append(np.quantile(votes.t_s[near], (0.1, 0.9)) if near.any() else (0, 0))
    (first, last), (other_first, other_last) = spans
    both = min(last, other_last) - max(first, other_first)
    shorter = min(last - first, other_last - other_first)
    return bool(both < _TOGETHER * shorter)


def _extent_deg(track: FollowedSource) -> float:
    """Returns the angle from the 10 % to the 90 % quantile of the bearings."""
    turned = np.unwrap(track.bearing_deg, period=360.0)
    return float(np.ptp(np.quantile(turned, (0.1, 0.9))))


def _passes(track: FollowedSource, source: HeardSource) -> bool:
    off = np.array(track.bearing_deg) - source.bearing_deg
    return bool(np.min(np.abs((off + 180.0) % 360.0 - 180.0)) < _NEAR_DEG)


def _doubted(told: _Told) -> _Told:
    return replace(told, confidence=min(told.confidence, _NOT_TOLD))


def _tracks(
    votes: DirectionVotes, seconds: float, plan: VotePlan
) -> list[FollowedSource]:
    heard: dict[int, list[tuple[float, SourceTrack]]] = {}
    parameters = ListenerParameters()
    # The time of a step is the end of its window. The bearing belongs to the middle.
    late = 0.5 * parameters.window_s
    for step in follow_sources(votes, seconds, plan, parameters):
        for track in step.tracks:
            if step.t_s - track.t_heard <= _PAUSE_S:
                at = round(step.t_s - late, 6), track
                heard.setdefault(track.identity, []).append(at)
    return [
        FollowedSource(
            identity,
            [t_s for t_s, _ in steps],
            [math.degrees(track.bearing) for _, track in steps],
            max(track.confidence for _, track in steps),
        )
        for identity, steps in heard.items()
    ]
