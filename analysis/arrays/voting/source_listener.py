"""Tracks sources in live sound, from blocks of samples to tracks at regular steps."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.voting.direction_votes import VoteMemory, VotePlan, cast_votes
from analysis.arrays.voting.source_tracks import TrackMemory, step_tracks
from analysis.arrays.voting.track_state import SourceTrack, TrackParameters
from analysis.arrays.voting.vote_peaks import VotedSource, gather_turning
from analysis.arrays.voting.vote_records import DirectionVotes, join_votes
from systems.framework.parameters import Parameters, Positive
from systems.sound.array_shape import ArrayShape

# _VOTES_S: least number of bins that vote for a source, per second of the window.
# _LEAST_VOTES: least number of bins that vote for a source in any window.
_VOTES_S, _LEAST_VOTES = 20.0, 6.0

# Least share of the bins with one wave whose phases must be those of a plane wave. In
# rooms and at an SNR of 0 dB it is 0.65 or more. If channels are late or in a wrong
# order, or if the positions are not in m, it is below 0.5.
_LEAST_FITTING = 0.55
# Least number of bins for which this share is known, and the time over which live sound
# is judged, s.
_LEAST_BINS, _FITTING_S = 30, 5.0

# Factor for the error of a detection. Windows overlap, so consecutive detections have
# similar errors.
_OVERLAP = 1.5

# Factor for the common error of a row's votes from 45 deg off its normal. The value is
# from simulated rooms.
_OF_ROWS = 3.0

# Exponent of the share in the votes of single bins, in the geometric mean with the
# share in the steered votes.
_OF_BINS = 0.4


class ListenerParameters(Parameters):
    """Parameters that determine how votes for directions become tracks of sources."""

    step_s: Positive = 0.1
    """Time from one step to the next, s."""
    window_s: Positive = 0.5
    """Length of the sound whose votes each step uses, s."""
    tracks: TrackParameters = TrackParameters()
    """Parameters of the motion and the detection of sources."""


@dataclass(frozen=True)
class TrackedSources:
    """Tracked sources at the end of a step."""

    t_s: float
    """End of the sound in which the sources were heard, s."""
    tracks: tuple[SourceTrack, ...]
    """Tracks of the sources. The oldest track is first."""
    unfit: bool = False
    """Whether the phases of the last seconds are not those of sound from far away at
    this array. The bearings may then be wrong."""


class _Tracking(NamedTuple):
    """All tracks, and how well the phases of the last seconds fit the array."""

    tracks: TrackMemory
    fits: NDArray[np.float64]
    """(2,) sums of ``DirectionVotes.group_fits``, in which older groups fade."""


@dataclass(frozen=True)
class ListenerMemory:
    """State of the listener between two blocks of samples.

    To make the initial state, call ``ListenerMemory.blank``.
    """

    votes: VoteMemory
    recent: DirectionVotes
    tracks: _Tracking
    samples: int
    """Number of samples per channel so far."""
    steps: int
    """Number of steps so far."""

    @classmethod
    def blank(cls, plan: VotePlan) -> ListenerMemory:
        """Makes the state before the first block."""
        return cls(plan.blank(), join_votes([]), _no_tracks(), 0, 0)

    def after_gap(self, plan: VotePlan, *, keeps_tracks: bool) -> ListenerMemory:
        """Returns the state after missing samples or a change of the channels.

        Times continue. With ``keeps_tracks``, the present tracks keep their identities;
        otherwise they end. A new track never gets the identity of an earlier track.
        """
        # The first group of frames after the gap begins at most one hop from its exact
        # time.
        votes = plan.blank()._replace(groups=round(self.samples / plan.hop))
        tracks = self.tracks.tracks
        if not keeps_tracks:
            tracks = replace(tracks, tracks=(), ended=())
        after = _no_tracks()._replace(tracks=tracks)
        return replace(self, votes=votes, recent=join_votes([]), tracks=after)


def hear_sources(
    block: NDArray[np.floating | np.integer],
    memory: ListenerMemory,
    plan: VotePlan,
    parameters: ListenerParameters,
) -> tuple[list[TrackedSources], ListenerMemory]:
    """Tracks sources in one more block of (n, k) samples, in any unit.

    The tracks are updated in steps of constant length, 0.1 s by default. A block may
    complete any number of steps.
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
            t_s = end / rate
            recent = _between(memory.recent, t_s - parameters.window_s, math.inf)
            sources, tracks = _tracked(recent, t_s, memory.tracks, plan, parameters)
            found.append(sources)
            memory = replace(
                memory, recent=recent, tracks=tracks, steps=memory.steps + 1
            )
    return found, memory


def follow_sources(
    votes: DirectionVotes,
    seconds: float,
    plan: VotePlan,
    parameters: ListenerParameters,
) -> list[TrackedSources]:
    """Tracks sources in a whole recording, from its votes in the order of time.

    The result is that of ``hear_sources``.
    """
    memory, found = _no_tracks(), []
    # The time of a vote is the middle of its samples. In live sound, the vote exists
    # only after its last sample.
    late = 0.5 * plan.group_samples / plan.sample_rate_hz - 1e-9
    for k in range(1, math.floor(seconds / parameters.step_s + 1e-9) + 1):
        t_s = k * parameters.step_s
        recent = _between(votes, t_s - parameters.window_s, t_s - late)
        sources, memory = _tracked(recent, t_s, memory, plan, parameters)
        found.append(sources)
    return found


def are_unfit(fits: NDArray[np.float64]) -> bool:
    """Returns whether a (2,) sum of ``group_fits`` shows that the array is wrong."""
    waves, fitting = fits
    return bool(waves >= _LEAST_BINS and fitting < _LEAST_FITTING * waves)


def _no_tracks() -> _Tracking:
    return _Tracking(TrackMemory(), np.zeros(2))


def _tracked(
    votes: DirectionVotes,
    t_s: float,
    memory: _Tracking,
    plan: VotePlan,
    parameters: ListenerParameters,
) -> tuple[TrackedSources, _Tracking]:
    least = max(_LEAST_VOTES, _VOTES_S * parameters.window_s)
    detections = [
        _detection(source, plan.shape)
        for source in gather_turning(
            votes, t_s - 0.5 * parameters.window_s, least_votes=least
        )
    ]
    told, tracks = step_tracks(detections, t_s, memory.tracks, parameters.tracks)
    # Each group is in as many windows as a window has steps.
    of_step = votes.group_fits.sum(axis=0) * parameters.step_s / parameters.window_s
    fits = math.exp(-parameters.step_s / _FITTING_S) * memory.fits + of_step
    return TrackedSources(t_s, tuple(told), are_unfit(fits)), _Tracking(tracks, fits)


def _detection(source: VotedSource, shape: ArrayShape) -> VotedSource:
    """Returns a source with the share and the errors of a single detection.

    A reflection that interferes with the direct sound turns the votes of single bins,
    even many of them in a short span of time. The steered response joins all
    frequencies, so its votes stay with the source. A source must have a share of both.

    All reflections at a row have shorter delays than sound along the row, so they turn
    bearings toward the normal of the row, the more the farther these are from it.
    """
    common = source.common_std
    if shape.kind == "row" and shape.ahead is not None:
        normal = math.atan2(shape.ahead[1], shape.ahead[0])
        common *= math.hypot(1.0, _OF_ROWS * math.sin(2.0 * (source.bearing - normal)))
    own = _OVERLAP * math.sqrt(source.own_variance)
    share = source.share
    if source.steered_share is not None:
        share = share**_OF_BINS * source.steered_share ** (1.0 - _OF_BINS)
    return source._replace(
        share=share, bearing_std=math.hypot(own, common), common_std=common
    )


def _between(votes: DirectionVotes, begin: float, end: float) -> DirectionVotes:
    inside = slice(*np.searchsorted(votes.t_s, (begin, end)))
    groups = slice(*np.searchsorted(votes.group_t_s, (begin, end)))
    return votes.part(inside, groups)
