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
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from scipy.optimize import linear_sum_assignment

from analysis.arrays.voting.vote_peaks import VotedSource, wrapped
from systems.framework.parameters import Fraction, Parameters, Positive

# Largest distance of a detection from its track, in standard deviations.
_GATE = 3.5

# _FALLS_SILENT: rate at which a sounding source pauses, 1/s.
# _SPEAKS_AGAIN: rate at which a pausing source sounds again, 1/s.
# _GOES: rate at which a source disappears, 1/s.
_FALLS_SILENT, _SPEAKS_AGAIN, _GOES = 1.0, 2.0, 0.2

# _BORN: probability that the first detection of a track is from a source.
# _RATE_STD: standard deviation of the bearing rate of a new track, rad/s.
_BORN, _RATE_STD = 0.05, 0.4


class TrackParameters(Parameters):
    """Parameters of the motion and the detection of sources."""

    acceleration_std_deg_s2: Positive = 6.0
    """Standard deviation of the change of a source's bearing rate within one second,
    deg/s^2."""
    rate_memory_s: Positive = 8.0
    """Time constant with which the estimated bearing rate decays, s."""
    detection_probability: Fraction = 0.7
    """Probability that a sounding source is detected in a step."""
    false_detections: Positive = 0.05
    """Mean number of false detections per step, over the whole circle."""
    smear_s: Positive = 0.15
    """Time that determines the scatter of the detections of a moving source, s. The
    scatter is the motion of the source in this time."""
    resolution_deg: float = Field(default=20.0, gt=0.0, le=90.0)
    """Angle below which two sources may give only one detection, deg."""
    begins_after_s: Positive = 0.25
    """Least age of a track that is reported, s."""
    least_share: Fraction = 0.25
    """Least share of the heard sound for the first detection of a track. The mean share
    of its detections must also be at least this value when the track is reported."""
    least_hits: int = Field(default=4, ge=1, le=100)
    """Least number of detections of a track that is reported."""
    ends_after_s: Positive = 1.5
    """Time without a detection after which a track ends, s. A detection that the track
    shares with a nearby track also counts."""
    hidden_s: Positive = 3.0
    """Time without a detection of its own after which a track ends, s. It limits how
    long a nearby track may hide a track."""


@dataclass(frozen=True)
class SourceTrack:
    """Track of one source."""

    identity: int
    """Number of the track, from 1. It is never used again. It is 0 until the track is
    reported."""
    bearing: float
    """Bearing, in (-pi, pi], rad."""
    rate: float
    """Rate of the bearing, rad/s."""
    covariance: NDArray[np.float64] = field(repr=False)
    """(2, 2) covariance of the bearing, rad, and its rate, rad/s."""
    elevation: float | None
    """Weighted mean of the latest elevations, rad. None if the array cannot measure
    them."""
    sounding: float
    """Probability that the source exists and sounds."""
    silent: float
    """Probability that the source exists and pauses."""
    t_born: float
    """Time of the first detection, s."""
    t_heard: float
    """Time of the last detection that is assigned to this track, s."""
    t_shared: float
    """Time of the last detection that this track shared with another track, s."""
    hits: int
    """Number of detections so far."""
    share: float
    """Mean share of the sound that its detections had in their steps, 0 to 1."""
    common_std: float = 0.0
    """Standard deviation of the error that is common to the latest detections, rad. The
    filter does not reduce it, so it is not part of ``covariance``."""

    @property
    def confidence(self) -> float:
        """Probability that the source exists."""
        return self.sounding + self.silent

    @property
    def bearing_std(self) -> float:
        """Standard deviation of the bearing, rad. It includes the common error."""
        return math.hypot(math.sqrt(float(self.covariance[0, 0])), self.common_std)


@dataclass(frozen=True)
class TrackMemory:
    """All tracks, including those that are not reported yet."""

    tracks: tuple[SourceTrack, ...] = ()
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
    tracks = [_predicted(track, elapsed, parameters) for track in memory.tracks]
    chosen = _assigned(tracks, detections, parameters)
    hidden = _hidden(tracks, detections, chosen, parameters)
    moved = [
        replace(track, t_shared=t_s)
        if i in hidden
        else replace(track, t_shared=t_s, t_heard=t_s)
        if i in hidden.values()
        else _missed(track, parameters)
        if k is None
        else _heard(track, detections[k], t_s, parameters)
        for i, (track, k) in enumerate(zip(tracks, chosen, strict=True))
    ]
    taken = {k for k in chosen if k is not None}
    new = [
        _born(detection, t_s)
        for k, detection in enumerate(detections)
        if k not in taken and detection.share >= parameters.least_share
    ]
    alive = _single([t for t in moved if not _over(t, t_s, parameters)], parameters)
    identity, kept = memory.next_identity, []
    for track in alive + new:
        if track.identity == 0 and _is_told(track, t_s, parameters):
            kept.append(replace(track, identity=identity))
            identity += 1
        else:
            kept.append(track)
    told = sorted((t for t in kept if t.identity > 0), key=lambda t: t.identity)
    return told, TrackMemory(tuple(kept), t_s, identity)


def _predicted(track: SourceTrack, dt: float, p: TrackParameters) -> SourceTrack:
    forget = math.exp(-dt / p.rate_memory_s)
    F = np.array([[1.0, dt], [0.0, forget]])
    q = math.radians(p.acceleration_std_deg_s2) ** 2
    Q = q * np.array([[dt**3 / 3.0, dt**2 / 2.0], [dt**2 / 2.0, dt]])
    falls, again = _FALLS_SILENT * dt, _SPEAKS_AGAIN * dt
    stays = math.exp(-_GOES * dt)
    # Exact share of changes within dt in a Markov chain with two states.
    part = -math.expm1(-(falls + again)) / max(falls + again, 1e-12)
    to_silent, to_sounding = falls * part, again * part
    sounding = track.sounding * (1.0 - to_silent) + track.silent * to_sounding
    silent = track.silent * (1.0 - to_sounding) + track.sounding * to_silent
    return replace(
        track,
        bearing=wrapped(track.bearing + dt * track.rate),
        rate=forget * track.rate,
        covariance=F @ track.covariance @ F.T + Q,
        sounding=stays * sounding,
        silent=stays * silent,
    )


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
            variance = float(track.covariance[0, 0]) + _scatter(track, d, p)
            off = wrapped(d.bearing - track.bearing)
            # Reported tracks have priority, so that a new track does not take their
            # detections.
            late = 0.0 if track.identity else 4.0
            cost[i, k] = off**2 / variance + math.log(variance) + late
            if off**2 > _GATE**2 * variance:
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
            apart = abs(wrapped(track.bearing - other.bearing))
            off = abs(wrapped(detections[k].bearing - track.bearing))
            if apart < resolution and off < resolution:
                hidden[i] = j
                break
    return hidden


def _scatter(track: SourceTrack, detection: VotedSource, p: TrackParameters) -> float:
    """Returns the variance of a detection relative to its track, rad^2."""
    rate_squared = track.rate**2 + float(track.covariance[1, 1])
    return detection.own_variance + p.smear_s**2 * rate_squared


def _heard(
    track: SourceTrack, detection: VotedSource, t_s: float, p: TrackParameters
) -> SourceTrack:
    of_detection = _scatter(track, detection, p)
    C = track.covariance
    variance = float(C[0, 0]) + of_detection
    off = wrapped(detection.bearing - track.bearing)
    gain = C[:, 0] / variance
    # Joseph's form of the covariance update keeps the covariance symmetric.
    A = np.eye(2) - np.outer(gain, [1.0, 0.0])
    height = math.exp(-0.5 * off**2 / variance) / math.sqrt(2.0 * math.pi * variance)
    density = p.false_detections / (2.0 * math.pi)
    ratio = 1.0 - p.detection_probability
    ratio += p.detection_probability * height / density
    sounding, silent = track.sounding * ratio, track.silent
    whole = sounding + silent + 1.0 - track.confidence
    elevation = detection.elevation
    if elevation is not None and track.elevation is not None:
        elevation = 0.7 * track.elevation + 0.3 * elevation
    common_std = 0.7 * track.common_std + 0.3 * detection.common_std
    return replace(
        track,
        bearing=wrapped(track.bearing + float(gain[0]) * off),
        rate=track.rate + float(gain[1]) * off,
        covariance=A @ C @ A.T + of_detection * np.outer(gain, gain),
        elevation=track.elevation if elevation is None else elevation,
        sounding=sounding / whole,
        silent=silent / whole,
        t_heard=t_s,
        hits=track.hits + 1,
        share=track.share + (detection.share - track.share) / (track.hits + 1),
        common_std=common_std,
    )


def _missed(track: SourceTrack, p: TrackParameters) -> SourceTrack:
    sounding = track.sounding * (1.0 - p.detection_probability)
    whole = sounding + track.silent + 1.0 - track.confidence
    return replace(track, sounding=sounding / whole, silent=track.silent / whole)


def _born(detection: VotedSource, t_s: float) -> SourceTrack:
    return SourceTrack(
        identity=0,
        bearing=wrapped(detection.bearing),
        rate=0.0,
        covariance=np.diag([detection.own_variance, _RATE_STD**2]),
        elevation=detection.elevation,
        sounding=_BORN,
        silent=0.0,
        t_born=t_s,
        t_heard=t_s,
        t_shared=-math.inf,
        hits=1,
        share=detection.share,
        common_std=detection.common_std,
    )


def _is_told(track: SourceTrack, t_s: float, p: TrackParameters) -> bool:
    old = t_s - track.t_born >= p.begins_after_s - 1e-9
    loud = track.share >= p.least_share
    return old and loud and track.hits >= p.least_hits and track.confidence > 0.9


def _over(track: SourceTrack, t_s: float, p: TrackParameters) -> bool:
    """Returns whether a track ends at the time t_s.

    A track that is not reported yet ends after a short pause. A reported track may
    pause longer, and even longer if another track may hide it.
    """
    silence = t_s - track.t_heard
    if track.identity == 0:
        return silence > p.begins_after_s
    since_hidden = t_s - max(track.t_heard, track.t_shared)
    return since_hidden > p.ends_after_s or silence > p.hidden_s


def _single(tracks: list[SourceTrack], p: TrackParameters) -> list[SourceTrack]:
    """Removes new tracks beside a reported track, because both have the same source."""
    kept: list[SourceTrack] = []
    near = math.radians(0.5 * p.resolution_deg)
    for track in sorted(tracks, key=lambda t: (t.identity == 0, t.t_born)):
        again = track.identity == 0 and any(
            abs(wrapped(track.bearing - other.bearing)) < near for other in kept
        )
        if not again:
            kept.append(track)
    return kept
