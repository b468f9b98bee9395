"""Tracks of several sources: each keeps its identity while it moves, pauses or crosses.

A Kalman filter a track, for a bearing that moves at a rate which changes slowly;
detections go to tracks by the likeliest assignment (global nearest neighbour, Blackman
and Popoli 1999, 6.4); a track exists with a probability that hits raise and misses
lower, and a source that pauses is not gone: "Markov chain two" of Musicki, Evans and
Stankovic 1994.

Two sources nearer than the detector resolves are one detection in between. It then
tells that both sound, but not where: motion decides which is which when they part.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from scipy.optimize import linear_sum_assignment

from systems.framework.parameters import Fraction, Parameters, Positive

# A detection farther from a track than so many deviations is not of it.
_GATE = 3.5

# Rates of a speaker who falls silent, who speaks again, and who is gone, 1/s.
_FALLS_SILENT, _SPEAKS_AGAIN, _GOES = 1.0, 2.0, 0.2

# Of a track's first detection: probability that there is a source, and what its rate
# may be, rad/s.
_BORN, _RATE_STD = 0.05, 0.4


class TrackParameters(Parameters):
    """How sources move and are heard."""

    acceleration_std_deg_s2: Positive = 6.0
    """How fast a source's rate of bearing changes, in a second, deg/s^2."""
    rate_memory_s: Positive = 8.0
    """Time after which a rate is forgotten, s."""
    detection_probability: Fraction = 0.7
    """That a source which sounds is detected in a step."""
    false_detections: Positive = 0.05
    """Mean number in a step, anywhere around the circle."""
    smear_s: Positive = 0.15
    """Detections of a source that moves scatter by what it moves in so long, s."""
    resolution_deg: float = Field(default=20.0, gt=0.0, le=90.0)
    """Sources nearer than this may be one detection, deg."""
    begins_after_s: Positive = 0.25
    """A track is told after so long, s."""
    least_share: Fraction = 0.25
    """A track begins where a detection has this share of what is heard, and it must
    have it on average of those until the track is told."""
    least_hits: int = Field(default=4, ge=1, le=100)
    """And after so many detections."""
    ends_after_s: Positive = 1.5
    """A track that was not heard for so long ends, s."""
    hidden_s: Positive = 3.0
    """And one that may be behind another one after so long, s."""


class Detection(NamedTuple):
    """A direction from which sound came in a step."""

    bearing: float
    """rad."""
    bearing_std: float
    """rad."""
    elevation: float | None
    """rad; None where the array does not tell it."""
    share: float = 1.0
    """Of all that was heard in the step, 0 to 1."""


@dataclass(frozen=True)
class SourceTrack:
    """A source that is followed."""

    identity: int
    """From 1; never used again."""
    bearing: float
    """rad, in (-pi, pi]."""
    rate: float
    """Of the bearing, rad/s."""
    covariance: NDArray[np.float64] = field(repr=False)
    """(2, 2) of bearing and rate."""
    elevation: float | None
    """Mean of the latest detections, rad; None where it is not told."""
    sounding: float
    """Probability that it exists and sounds."""
    silent: float
    """Probability that it exists and pauses."""
    t_born: float
    """First detection, s."""
    t_heard: float
    """Last detection of its own, s."""
    t_shared: float
    """Last detection that it shared with another track, s."""
    hits: int
    """Detections so far."""
    share: float
    """Mean of its detections, of what was heard in their steps."""

    @property
    def confidence(self) -> float:
        """Probability that there is a source."""
        return self.sounding + self.silent

    @property
    def bearing_std(self) -> float:
        """rad."""
        return math.sqrt(float(self.covariance[0, 0]))


@dataclass(frozen=True)
class TrackMemory:
    """All tracks, those that are not told yet as well."""

    tracks: tuple[SourceTrack, ...] = ()
    t_s: float | None = None
    """Of the last step; None before the first."""
    next_identity: int = 1


def step_tracks(
    detections: Sequence[Detection],
    t_s: float,
    memory: TrackMemory,
    parameters: TrackParameters,
) -> tuple[list[SourceTrack], TrackMemory]:
    """The sources after another step.

    Args:
        detections: Of this step, in any order.
        t_s: Its time, s; steps need not be equal.
        memory: ``TrackMemory()`` at first.
        parameters: How sources move and are heard.

    Returns:
        The tracks that are told, oldest first, and the new memory. A track gets its
        identity when it is told.

    Raises:
        ValueError: Time does not run forward.
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
    """Later by dt."""
    forget = math.exp(-dt / p.rate_memory_s)
    F = np.array([[1.0, dt], [0.0, forget]])
    q = math.radians(p.acceleration_std_deg_s2) ** 2
    Q = q * np.array([[dt**3 / 3.0, dt**2 / 2.0], [dt**2 / 2.0, dt]])
    falls, again = _FALLS_SILENT * dt, _SPEAKS_AGAIN * dt
    stays = math.exp(-_GOES * dt)
    # The exact share of a chain of two states that changes at these rates.
    part = -math.expm1(-(falls + again)) / max(falls + again, 1e-12)
    to_silent, to_sounding = falls * part, again * part
    sounding = track.sounding * (1.0 - to_silent) + track.silent * to_sounding
    silent = track.silent * (1.0 - to_sounding) + track.sounding * to_silent
    return replace(
        track,
        bearing=_wrapped(track.bearing + dt * track.rate),
        rate=forget * track.rate,
        covariance=F @ track.covariance @ F.T + Q,
        sounding=stays * sounding,
        silent=stays * silent,
    )


def _assigned(
    tracks: Sequence[SourceTrack],
    detections: Sequence[Detection],
    p: TrackParameters,
) -> list[int | None]:
    """The detection of each track."""
    chosen: list[int | None] = [None] * len(tracks)
    if not tracks or not detections:
        return chosen
    cost = np.empty((len(tracks), len(detections)))
    for i, track in enumerate(tracks):
        for k, d in enumerate(detections):
            variance = float(track.covariance[0, 0]) + _scatter(track, d, p)
            off = _wrapped(d.bearing - track.bearing)
            # Tracks that were told come first: what is new must not take theirs.
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
    detections: Sequence[Detection],
    chosen: list[int | None],
    p: TrackParameters,
) -> dict[int, int]:
    """Tracks without a detection that is near them and another one, by that one's."""
    resolution = math.radians(p.resolution_deg)
    hidden: dict[int, int] = {}
    for i, track in enumerate(tracks):
        if chosen[i] is not None or not track.identity:
            continue
        for j, other in enumerate(tracks):
            k = chosen[j]
            if k is None or not other.identity:
                continue
            apart = abs(_wrapped(track.bearing - other.bearing))
            off = abs(_wrapped(detections[k].bearing - track.bearing))
            if apart < resolution and off < resolution:
                hidden[i] = j
                break
    return hidden


def _scatter(track: SourceTrack, detection: Detection, p: TrackParameters) -> float:
    """Variance of a detection about its track, rad^2."""
    rate_squared = track.rate**2 + float(track.covariance[1, 1])
    return detection.bearing_std**2 + p.smear_s**2 * rate_squared


def _heard(
    track: SourceTrack,
    detection: Detection,
    t_s: float,
    p: TrackParameters,
) -> SourceTrack:
    """With its detection."""
    of_detection = _scatter(track, detection, p)
    C = track.covariance
    variance = float(C[0, 0]) + of_detection
    off = _wrapped(detection.bearing - track.bearing)
    gain = C[:, 0] / variance
    # Joseph's form stays symmetric.
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
    return replace(
        track,
        bearing=_wrapped(track.bearing + float(gain[0]) * off),
        rate=track.rate + float(gain[1]) * off,
        covariance=A @ C @ A.T + of_detection * np.outer(gain, gain),
        elevation=track.elevation if elevation is None else elevation,
        sounding=sounding / whole,
        silent=silent / whole,
        t_heard=t_s,
        hits=track.hits + 1,
        share=track.share + (detection.share - track.share) / (track.hits + 1),
    )


def _missed(track: SourceTrack, p: TrackParameters) -> SourceTrack:
    sounding = track.sounding * (1.0 - p.detection_probability)
    whole = sounding + track.silent + 1.0 - track.confidence
    return replace(track, sounding=sounding / whole, silent=track.silent / whole)


def _born(detection: Detection, t_s: float) -> SourceTrack:
    return SourceTrack(
        identity=0,
        bearing=_wrapped(detection.bearing),
        rate=0.0,
        covariance=np.diag([detection.bearing_std**2, _RATE_STD**2]),
        elevation=detection.elevation,
        sounding=_BORN,
        silent=0.0,
        t_born=t_s,
        t_heard=t_s,
        t_shared=-math.inf,
        hits=1,
        share=detection.share,
    )


def _is_told(track: SourceTrack, t_s: float, p: TrackParameters) -> bool:
    old = t_s - track.t_born >= p.begins_after_s - 1e-9
    loud = track.share >= p.least_share
    return old and loud and track.hits >= p.least_hits and track.confidence > 0.9


def _over(track: SourceTrack, t_s: float, p: TrackParameters) -> bool:
    """What is not told yet may not pause, and what is hidden not for ever."""
    silence = t_s - track.t_heard
    if track.identity == 0:
        return silence > p.begins_after_s
    since_hidden = t_s - max(track.t_heard, track.t_shared)
    return since_hidden > p.ends_after_s or silence > p.hidden_s


def _single(tracks: list[SourceTrack], p: TrackParameters) -> list[SourceTrack]:
    """Without new tracks beside one that is told: they are of the same source."""
    kept: list[SourceTrack] = []
    near = math.radians(0.5 * p.resolution_deg)
    for track in sorted(tracks, key=lambda t: (t.identity == 0, t.t_born)):
        again = track.identity == 0 and any(
            abs(_wrapped(track.bearing - other.bearing)) < near for other in kept
        )
        if not again:
            kept.append(track)
    return kept


def _wrapped(angle: float) -> float:
    """In (-pi, pi]."""
    return math.pi - (math.pi - angle) % (2.0 * math.pi)
