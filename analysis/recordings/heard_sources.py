"""All sources of a recording: where each is, and its track over time."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.voting.direction_votes import (
    DirectionVotes,
    VotePlan,
    cast_votes,
    join_votes,
)
from analysis.arrays.voting.listening_plan import vote_plan
from analysis.arrays.voting.source_listener import ListenerParameters, follow_sources
from analysis.arrays.voting.steady_sound import is_steady, steered_only
from analysis.arrays.voting.vote_peaks import VotedSource, gather_sources
from systems.sound.array_shape import ArrayShape

# Samples of a channel that vote at once.
_BLOCK = 2**16

# Where a source was not heard for longer its place is a guess, s.
_PAUSE_S = 0.3

# A track that turns by more moves, and what is within so much of it is the same, deg.
_MOVES_DEG, _NEAR_DEG = 20.0, 8.0

# Of the time in which the one of two directions is heard that is heard for less: if the
# other is heard too in less of that, they may be of one source that moves.
_TOGETHER = 0.25

# What is not told has no greater confidence.
_NOT_TOLD = 0.5


@dataclass(frozen=True)
class HeardSource:
    """A direction from which sound came, over the whole recording."""

    bearing_deg: float
    """Azimuth from the microphones' centroid, CCW from +x, in (-180, 180]."""
    bearing_std_deg: float
    """By the scatter of what votes for it; errors of the array are not in it."""
    elevation_deg: float | None
    """From the x-y plane; None where the array does not tell it."""
    share: float
    """Of all that votes, 0 to 1."""
    confidence: float
    """0 to 1."""

    @classmethod
    def of(cls, voted: VotedSource) -> HeardSource:
        """From a peak of votes.

        Args:
            voted: The peak.

        Returns:
            The same in deg.
        """
        height = voted.elevation
        return cls(
            bearing_deg=math.degrees(voted.bearing),
            bearing_std_deg=math.degrees(voted.bearing_std),
            elevation_deg=None if height is None else math.degrees(height),
            share=voted.share,
            confidence=voted.confidence,
        )


@dataclass(frozen=True)
class FollowedSource:
    """A source that was followed for some time."""

    identity: int
    """From 1, in the order in which they began."""
    t_s: list[float]
    """Times, s from the start of the recording."""
    bearing_deg: list[float]
    """Its bearing at each."""
    confidence: float
    """Greatest probability that it existed, 0 to 1."""


@dataclass(frozen=True)
class HeardSources:
    """All that was heard in a recording."""

    sources: list[HeardSource] = field(default_factory=list)
    """The one that is heard most first."""
    tracks: list[FollowedSource] = field(default_factory=list)
    """In order of their begin."""
    steady: bool = False
    """The sound is steady: where most of it comes from is told, but not whether it
    is one source or several. No confidence is above 0.5."""


_Told = TypeVar("_Told", HeardSource, FollowedSource)


def heard_sources(
    channels: NDArray[np.float32],
    shape: ArrayShape,
    c: float,
    sample_rate_hz: float,
    band_hz: tuple[float, float],
) -> HeardSources:
    """Every source that stands out, and its track.

    Args:
        channels: (n, samples).
        shape: The n microphones.
        c: Speed of sound, m/s.
        sample_rate_hz: Of the samples, Hz.
        band_hz: Lowest and highest frequency that counts, Hz.

    Returns:
        The sources and tracks; none for an array that tells no bearings.
    """
    if "bearing" not in shape.angles:
        return HeardSources()
    plan = vote_plan(shape, c, sample_rate_hz, band_hz)
    memory, parts = plan.blank(), []
    for first in range(0, channels.shape[1], _BLOCK):
        votes, memory = cast_votes(plan, memory, channels[:, first : first + _BLOCK])
        parts.append(votes)
    votes = join_votes(parts)
    steady = is_steady(votes)
    if steady:
        votes = steered_only(votes)
    sources = [HeardSource.of(voted) for voted in gather_sources(votes)]
    tracks = _tracks(votes, channels.shape[1] / sample_rate_hz, plan)
    sources = _counted_once(sources, tracks, votes)
    if steady:
        sources = [_doubted(source) for source in sources[:1]]
        tracks = [_doubted(track) for track in tracks]
    return HeardSources(sources, tracks, steady)


def _counted_once(
    sources: list[HeardSource], tracks: list[FollowedSource], votes: DirectionVotes
) -> list[HeardSource]:
    """Without directions that a source passed on its way, after or before another."""
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
    """Whether two directions are hardly heard at the same time."""
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
    """How far it moved between the places where it was most of the time."""
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
    tracks: dict[int, FollowedSource] = {}
    parameters = ListenerParameters()
    # A step ends with the sound that it gathers: the bearing is that of its middle.
    late = 0.5 * parameters.window_s
    for step in follow_sources(votes, seconds, plan, parameters):
        for track in step.tracks:
            if step.t_s - track.t_heard > _PAUSE_S:
                continue
            known = tracks.setdefault(
                track.identity, FollowedSource(track.identity, [], [], 0.0)
            )
            known.t_s.append(round(step.t_s - late, 6))
            known.bearing_deg.append(math.degrees(track.bearing))
            sure = max(known.confidence, track.confidence)
            tracks[track.identity] = FollowedSource(
                track.identity, known.t_s, known.bearing_deg, sure
            )
    return list(tracks.values())
