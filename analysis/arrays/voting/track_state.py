"""The state of the track of a source, its motion, and its updates by detections."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from analysis.arrays.voting.vote_bearings import wrapped
from analysis.arrays.voting.vote_peaks import VotedSource
from systems.framework.parameters import Fraction, Parameters, Positive

#: Largest distance of a detection from its track, in standard deviations.
GATE = 3.5

# _FALLS_SILENT: rate at which a sounding source pauses, 1/s.
# _SPEAKS_AGAIN: rate at which a pausing source sounds again, 1/s.
# _GOES: rate at which a source disappears, 1/s.
_FALLS_SILENT, _SPEAKS_AGAIN, _GOES = 1.0, 2.0, 0.2

# Largest difference of elevations of one source, rad. In rooms they are too high.
_ELEVATION_ERROR = math.radians(40.0)

#: Standard deviation of the bias of a detection by other sources and reflections, rad.
#: It widens the gate of a track, but many detections do not average it out.
BIAS_STD = math.radians(3.0)

# Time constant with which the rate of a track that is not heard decays, s. Most sources
# that pause are at rest, and a rate from noise must not carry the track away. Rates
# above _TURNING, rad/s, are not from noise. After less than _PAUSE_S, s, another source
# may only mask the track, as when two sources cross.
_RATE_FADES_S, _TURNING, _PAUSE_S = 0.4, math.radians(25.0), 0.9

# Standard deviation of the measured rate of a source that turns fast, rad/s.
_TURN_STD = 0.3

# _BORN: probability that the first detection of a track is from a source.
# _RATE_STD: standard deviation of the bearing rate of a new track, rad/s.
_BORN, _RATE_STD = 0.05, 0.8


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
    smear_s: Positive = 0.1
    """Time that determines the scatter of the detections of a moving source, s. The
    scatter is the motion of the source in this time."""
    resolution_deg: float = Field(default=20.0, gt=0.0, le=90.0)
    """Angle below which two sources may give only one detection, deg."""
    begins_after_s: Positive = 0.25
    """Least age of a track that is reported, s. While another source sounds, the least
    age is twice as long."""
    least_share: Fraction = 0.25
    """Least share of the heard sound for the first detection of a track. The mean share
    of its detections must also be at least this value when the track is reported, and
    at least 80 % of it afterwards."""
    least_hits: int = Field(default=4, ge=1, le=100)
    """Least number of detections of a track that is reported."""
    ends_after_s: Positive = 1.5
    """Time without a detection after which a track ends, s. A detection that the track
    shares with a nearby track also counts."""
    hidden_s: Positive = 3.0
    """Time without a detection of its own after which a track ends, s. It limits how
    long a nearby track may hide a track."""
    remembered_s: Positive = 10.0
    """Time for which the identity of a track that is not heard is remembered, s. A
    source that sounds again near its last bearing gets its identity back."""
    returns_within_deg: float = Field(default=15.0, gt=0.0, le=90.0)
    """Largest distance of such a source from its last bearing, deg."""


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
    """Standard deviation of the error that is common to the latest detections, rad. It
    includes the scatter of the detections beyond their own errors, which reflections
    cause. The filter does not reduce it, so it is not part of ``covariance``."""

    @property
    def confidence(self) -> float:
        """Probability that the source exists."""
        return self.sounding + self.silent

    @property
    def bearing_std(self) -> float:
        """Standard deviation of the bearing, rad. It includes the common error."""
        return math.hypot(math.sqrt(float(self.covariance[0, 0])), self.common_std)


def apart_rad(first: SourceTrack | VotedSource, second: SourceTrack) -> float:
    """Returns the angle between two directions, rad.

    It is less than that between their bearings if both are steep.
    """
    off = abs(wrapped(first.bearing - second.bearing))
    if first.elevation is None or second.elevation is None:
        return float(off)
    steep = min(abs(first.elevation), abs(second.elevation))
    across = float(off) * math.cos(steep)
    return max(across, abs(first.elevation - second.elevation) - _ELEVATION_ERROR)


def predicted(
    track: SourceTrack, t_s: float, dt: float, p: TrackParameters
) -> SourceTrack:
    """Returns a track after a time dt, s, at the time t_s.

    While a track pauses, its rate fades.
    """
    pauses = t_s - max(track.t_heard, track.t_shared) > _PAUSE_S
    fades = pauses and abs(track.rate) < _TURNING
    forget = math.exp(-dt / (_RATE_FADES_S if fades else p.rate_memory_s))
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


def scatter(track: SourceTrack, detection: VotedSource, p: TrackParameters) -> float:
    """Returns the variance of a detection relative to its track, rad^2."""
    rate_squared = track.rate**2 + float(track.covariance[1, 1])
    return detection.own_variance + p.smear_s**2 * rate_squared


def innovation(track: SourceTrack, detection: VotedSource) -> tuple[float, float]:
    """Returns how far a detection is from its prediction, rad, and its variance, rad^2.

    The variance is that of the prediction, at the time of the detection.
    """
    H = np.array([1.0, detection.later_s])
    off = wrapped(detection.bearing - track.bearing - detection.later_s * track.rate)
    return off, float(H @ track.covariance @ H)


def heard(
    track: SourceTrack, detection: VotedSource, t_s: float, p: TrackParameters
) -> SourceTrack:
    """Returns a track after a step with a detection of it."""
    # The louder other sources are, the more they shift a detection.
    of_detection = scatter(track, detection, p)
    of_detection *= max(1.0, track.share / max(detection.share, 0.01)) ** 2
    C, rate = track.covariance, track.rate
    if detection.rate:
        # The rate of a source that turns fast is measured as well.
        share = C[:, 1] / (float(C[1, 1]) + _TURN_STD**2)
        turned = share * (detection.rate - rate)
        track = replace(track, bearing=track.bearing + float(turned[0]))
        rate += float(turned[1])
        C = C - np.outer(share, C[1])
    H = np.array([1.0, detection.later_s])
    off, variance = innovation(replace(track, rate=rate, covariance=C), detection)
    if off**2 > GATE**2 * (variance + of_detection):
        of_detection += BIAS_STD**2
    variance += of_detection
    gain = C @ H / variance
    # Joseph's form of the covariance update keeps the covariance symmetric.
    A = np.eye(2) - np.outer(gain, H)
    height = math.exp(-0.5 * off**2 / variance) / math.sqrt(2.0 * math.pi * variance)
    density = p.false_detections / (2.0 * math.pi)
    ratio = 1.0 - p.detection_probability
    ratio += p.detection_probability * height / density
    sounding, silent = track.sounding * ratio, track.silent
    whole = sounding + silent + 1.0 - track.confidence
    # Detections that scatter more than stated have an error that changes slowly.
    common = detection.common_std**2 + max(off**2 - variance, 0.0)
    elevation = detection.elevation
    if elevation is not None and track.elevation is not None:
        elevation = 0.7 * track.elevation + 0.3 * elevation
    return replace(
        track,
        bearing=wrapped(track.bearing + float(gain[0]) * off),
        rate=rate + float(gain[1]) * off,
        covariance=A @ C @ A.T + of_detection * np.outer(gain, gain),
        elevation=track.elevation if elevation is None else elevation,
        sounding=sounding / whole,
        silent=silent / whole,
        t_heard=t_s,
        hits=track.hits + 1,
        share=track.share + (detection.share - track.share) / (track.hits + 1),
        common_std=math.sqrt(0.7 * track.common_std**2 + 0.3 * common),
    )


def missed(track: SourceTrack, p: TrackParameters) -> SourceTrack:
    """Returns a track after a step without a detection of it."""
    sounding = track.sounding * (1.0 - p.detection_probability)
    whole = sounding + track.silent + 1.0 - track.confidence
    return replace(track, sounding=sounding / whole, silent=track.silent / whole)


def born(detection: VotedSource, t_s: float) -> SourceTrack:
    """Returns a new track from its first detection."""
    rate_std = _TURN_STD if detection.rate else _RATE_STD
    later = np.array([-detection.later_s, 1.0])
    return SourceTrack(
        identity=0,
        bearing=wrapped(detection.bearing),
        rate=detection.rate,
        covariance=np.diag([detection.own_variance, 0.0])
        + rate_std**2 * np.outer(later, later),
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
