"""Sources heard live: from blocks of samples to tracks, a step at a time."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.voting.direction_votes import (
    DirectionVotes,
    VoteMemory,
    VotePlan,
    cast_votes,
    join_votes,
)
from analysis.arrays.voting.source_tracks import (
    Detection,
    SourceTrack,
    TrackMemory,
    TrackParameters,
    step_tracks,
)
from analysis.arrays.voting.vote_peaks import gather_sources
from systems.framework.parameters import Parameters, Positive

# Bins that vote for a source in a window, for each second of it, and at least.
_VOTES_S, _LEAST_VOTES = 20.0, 6.0

# Windows overlap, so that the errors of neighbouring ones are alike: a detection counts
# as one that is off by this much more.
_OVERLAP = 1.5


class ListenerParameters(Parameters):
    """How votes become tracks."""

    step_s: Positive = 0.1
    """Time from step to step, s."""
    window_s: Positive = 0.5
    """Length of sound whose votes a step gathers, s."""
    tracks: TrackParameters = TrackParameters()
    """How sources move and are heard."""


@dataclass(frozen=True)
class TrackedSources:
    """The sources at the end of a step."""

    t_s: float
    """End of the sound that they were heard in, s."""
    tracks: tuple[SourceTrack, ...]
    """Oldest first."""


@dataclass(frozen=True)
class ListenerMemory:
    """What the sound so far leaves behind. Make one by ``ListenerMemory.blank``."""

    votes: VoteMemory
    recent: DirectionVotes
    tracks: TrackMemory
    samples: int
    """Heard so far, of a channel."""
    steps: int
    """Done so far."""

    @classmethod
    def blank(cls, plan: VotePlan) -> ListenerMemory:
        """Before the first block.

        Args:
            plan: How the array votes.

        Returns:
            The memory.
        """
        return cls(plan.blank(), join_votes([]), TrackMemory(), 0, 0)

    def after_gap(self, plan: VotePlan, *, keeps_tracks: bool) -> ListenerMemory:
        """Where samples are missing, or from where on other channels count.

        Args:
            plan: How the array votes from here on.
            keeps_tracks: Whether the sources are still those of before.

        Returns:
            The memory; times go on, and no identity is used again.
        """
        # The first group of frames after it begins within a hop of where it should.
        votes = plan.blank()._replace(groups=round(self.samples / plan.hop))
        tracks = self.tracks if keeps_tracks else replace(self.tracks, tracks=())
        return replace(self, votes=votes, recent=join_votes([]), tracks=tracks)


def hear_sources(
    block: NDArray[np.floating | np.integer],
    memory: ListenerMemory,
    plan: VotePlan,
    parameters: ListenerParameters,
) -> tuple[list[TrackedSources], ListenerMemory]:
    """The steps that another block of samples completes.

    Args:
        block: (n, k) samples of each channel, any unit, any k.
        memory: What the last block left.
        plan: How the array votes.
        parameters: How votes become tracks.

    Returns:
        The sources of each step, and the new memory.

    Raises:
        InputError: The block has other channels than the array, or is not finite.
    """
    rate = plan.sample_rate_hz
    found, first = [], 0
    while first < block.shape[1]:
        end = round((memory.steps + 1) * parameters.step_s * rate)
        last = min(block.shape[1], first + end - memory.samples)
        votes, left = cast_votes(plan, memory.votes, block[:, first:last])
        memory = replace(
            memory,
            votes=left,
            recent=join_votes([memory.recent, votes]),
            samples=memory.samples + last - first,
        )
        first = last
        if memory.samples == end:
            sources, memory = _step(memory, rate, parameters)
            found.append(sources)
    return found, memory


def follow_sources(
    votes: DirectionVotes,
    seconds: float,
    plan: VotePlan,
    parameters: ListenerParameters,
) -> list[TrackedSources]:
    """The same for a recording whose votes are all known.

    Args:
        votes: Of all of it, in order of time.
        seconds: Its length, s.
        plan: How the array voted.
        parameters: How votes become tracks.

    Returns:
        The sources of each step, as ``hear_sources`` tells them.
    """
    memory, found = TrackMemory(), []
    # A vote stands in the middle of what it was cast on, and live it comes at its end.
    late = 0.5 * plan.group_samples / plan.sample_rate_hz - 1e-9
    for k in range(1, math.floor(seconds / parameters.step_s + 1e-9) + 1):
        t_s = k * parameters.step_s
        recent = _between(votes, t_s - parameters.window_s, t_s - late)
        told, memory = step_tracks(
            _detections(recent, parameters), t_s, memory, parameters.tracks
        )
        found.append(TrackedSources(t_s, tuple(told)))
    return found


def _step(
    memory: ListenerMemory, rate: float, parameters: ListenerParameters
) -> tuple[TrackedSources, ListenerMemory]:
    t_s = memory.samples / rate
    recent = _between(memory.recent, t_s - parameters.window_s, math.inf)
    told, tracks = step_tracks(
        _detections(recent, parameters), t_s, memory.tracks, parameters.tracks
    )
    after = replace(memory, recent=recent, tracks=tracks, steps=memory.steps + 1)
    return TrackedSources(t_s, tuple(told)), after


def _detections(
    recent: DirectionVotes, parameters: ListenerParameters
) -> list[Detection]:
    least = max(_LEAST_VOTES, _VOTES_S * parameters.window_s)
    return [
        Detection(
            source.bearing,
            _OVERLAP * source.bearing_std,
            source.elevation,
            source.share,
        )
        for source in gather_sources(recent, least_votes=least)
    ]


def _between(votes: DirectionVotes, begin: float, end: float) -> DirectionVotes:
    inside = slice(*np.searchsorted(votes.t_s, (begin, end)))
    groups = slice(*np.searchsorted(votes.group_t_s, (begin, end)))
    return DirectionVotes._make(
        [*(each[inside] for each in votes[:5]), *(each[groups] for each in votes[5:])]
    )
