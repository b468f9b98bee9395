"""Tracks several sources. Each keeps its identity while it moves, pauses or crosses.

Each track has a Kalman filter for the bearing. The filter assumes that the rate of the
bearing changes slowly. Detections are assigned to tracks by the most likely assignment
(global nearest neighbor, Blackman and Popoli 1999, section 6.4).

Each track has a probability of existence. Detections increase it, and missed detections
decrease it. A source that pauses continues to exist, as in "Markov chain two" of
Musicki, Evans and Stankovic 1994.

If two sources are nearer to each other than the resolution of the detector, they give
one detection between them. This detection shows that both sources sound, but does not
give their bearings. When the sources separate, their predicted motion decides which is
which.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from analysis.arrays.voting.track_state import (
    BIAS_STD,
    GATE,
    SourceTrack,
    TrackParameters,
    apart_rad,
    born,
    heard,
    innovation,
    missed,
    predicted,
    scatter,
)
from analysis.arrays.voting.vote_peaks import VotedSource

# Largest angle between a detection and its track, rad.
_FARTHEST = math.radians(45.0)

# A reported track ends if the mean share of its detections falls below this part of
# ``TrackParameters.least_share``. Most such tracks are reflections.
_KEPT = 0.8

# While another source sounds, a new track must be so many times as old before it is
# reported. Two sources that sound together also cause votes between them, but these
# rarely last.
_BESIDE = 2.0


@dataclass(frozen=True)
class TrackMemory:
    """All tracks, including those that are not reported yet."""

    tracks: tuple[SourceTrack, ...] = ()
    ended: tuple[SourceTrack, ...] = ()
    """Tracks that have ended, but whose identities are remembered."""
    t_s: float | None = None
    """Time of the last step, s. None before the first step."""
    next_identity: int = 1


def step_tracks(
    detections: Sequence[VotedSource],
    t_s: float,
    memory: TrackMemory,
    parameters: TrackParameters,
) -> tuple[list[SourceTrack], TrackMemory]:
    """Updates the tracks with the detections of one step, and returns those to report.

    Steps may have different lengths. The first memory is ``TrackMemory()``. A track
    gets its identity when it is first reported. The oldest track is first.
    """
    elapsed = 0.0 if memory.t_s is None else t_s - memory.t_s
    if elapsed < 0.0:
        raise ValueError(f"t_s: {t_s:g} s is before the last step, {memory.t_s:g} s")
    tracks = [predicted(track, t_s, elapsed, parameters) for track in memory.tracks]
    chosen = _assigned(tracks, detections, parameters)
    hidden = _hidden(tracks, detections, chosen, parameters)
    moved = [
        replace(track, t_shared=t_s)
        if i in hidden
        else replace(track, t_shared=t_s, t_heard=t_s)
        if i in hidden.values()
        else missed(track, parameters)
        if k is None
        else heard(track, detections[k], t_s, parameters)
        for i, (track, k) in enumerate(zip(tracks, chosen, strict=True))
    ]
    taken = {k for k in chosen if k is not None}
    new = [
        born(detection, t_s)
        for k, detection in enumerate(detections)
        if k not in taken and detection.share >= parameters.least_share
    ]
    over = [t for t in moved if _over(t, t_s, parameters)]
    alive = _single([t for t in moved if t not in over], parameters)
    ended = [
        track
        for track in (*memory.ended, *over)
        if track.identity and t_s - track.t_heard <= parameters.remembered_s
    ]
    identity, kept = memory.next_identity, [*alive, *new]
    others = any(track.identity and track.sounding > 0.5 for track in alive)
    least_s = parameters.begins_after_s * (_BESIDE if others else 1.0)
    for track in alive + new:
        if track.identity or not _is_told(track, t_s, least_s, parameters):
            continue
        kept.remove(track)
        old = _returned(track, [t for t in kept if t.identity] + ended, parameters)
        if old is None:
            kept.append(replace(track, identity=identity))
            identity += 1
        else:
            kept = [t for t in kept if t is not old]
            ended = [t for t in ended if t is not old]
            kept.append(replace(track, identity=old.identity))
    told = sorted((t for t in kept if t.identity > 0), key=lambda t: t.identity)
    return told, TrackMemory(tuple(kept), tuple(ended), t_s, identity)


def _returned(
    track: SourceTrack, others: Sequence[SourceTrack], p: TrackParameters
) -> SourceTrack | None:
    """Returns the nearest track that was last heard before a new track began."""
    near = [
        other
        for other in others
        if max(other.t_heard, other.t_shared) < track.t_born
        and apart_rad(track, other) < math.radians(p.returns_within_deg)
    ]
    return min(near, key=lambda other: apart_rad(track, other), default=None)


def _assigned(
    tracks: Sequence[SourceTrack], detections: Sequence[VotedSource], p: TrackParameters
) -> list[int | None]:
    """Returns the number of the detection of each track, or None."""
    chosen: list[int | None] = [None] * len(tracks)
    if not tracks or not detections:
        return chosen
    cost = np.empty((len(tracks), len(detections)))
    for i, track in enumerate(tracks):
        for k, d in enumerate(detections):
            off, variance = innovation(track, d)
            variance += scatter(track, d, p)
            # Reported tracks have priority, so that a new track does not take their
            # detections.
            late = 0.0 if track.identity else 4.0
            cost[i, k] = off**2 / variance + math.log(variance) + late
            wide = variance + BIAS_STD**2
            if off**2 > GATE**2 * wide or apart_rad(d, track) > _FARTHEST:
                cost[i, k] = np.inf
    finite = np.where(np.isfinite(cost), cost, 1e6)
    for i, k in zip(*linear_sum_assignment(finite), strict=True):
        if np.isfinite(cost[i, k]):
            chosen[i] = int(k)
    return chosen


def _hidden(
    tracks: Sequence[SourceTrack],
    detections: Sequence[VotedSource],
    chosen: list[int | None],
    p: TrackParameters,
) -> dict[int, int]:
    """Returns the tracks that another nearby track may hide, and that other track."""
    resolution = math.radians(p.resolution_deg)
    hidden: dict[int, int] = {}
    for i, track in enumerate(tracks):
        if chosen[i] is not None or not track.identity:
            continue
        for j, other in enumerate(tracks):
            k = chosen[j]
            if k is None or not other.identity:
                continue
            apart = apart_rad(track, other)
            off = apart_rad(detections[k], track)
            if apart < resolution and off < resolution:
                hidden[i] = j
                break
    return hidden


def _is_told(
    track: SourceTrack, t_s: float, least_s: float, p: TrackParameters
) -> bool:
    old = track.t_heard == t_s and t_s - track.t_born >= least_s - 1e-9
    loud = track.share >= p.least_share
    return old and loud and track.hits >= p.least_hits and track.confidence > 0.9


def _over(track: SourceTrack, t_s: float, p: TrackParameters) -> bool:
    """Returns whether a track ends at the time t_s.

    A track that is not reported yet ends after a short pause. A reported track may
    pause longer, and even longer if another track may hide it. It ends at once if its
    share of the sound has become too small.
    """
    silence = t_s - track.t_heard
    if track.identity == 0:
        return silence > p.begins_after_s
    if track.share < _KEPT * p.least_share:
        return True
    since_hidden = t_s - max(track.t_heard, track.t_shared)
    return since_hidden > p.ends_after_s or silence > p.hidden_s


def _single(tracks: list[SourceTrack], p: TrackParameters) -> list[SourceTrack]:
    """Removes new tracks beside a reported track, because both have the same source."""
    kept: list[SourceTrack] = []
    near = math.radians(0.5 * p.resolution_deg)
    for track in sorted(tracks, key=lambda t: (t.identity == 0, t.t_born)):
        again = track.identity == 0 and any(
            apart_rad(track, other) < near for other in kept
        )
        if not again:
            kept.append(track)
    return kept
