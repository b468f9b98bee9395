"""Parameters of estimators, of the tracker and of ideal hearing."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

from systems.framework.input_error import InputError
from systems.framework.parameters import (
    Angle,
    Duration,
    Fraction,
    Frequency,
    Length,
    NonNegative,
    NonNegativeLength,
    Parameters,
    Positive,
    SoundSpeed,
    Speed,
)
from systems.framework.signals import SAMPLE_RATE_HZ


class TDOAParameters(Parameters):
    """How delays are measured, and when they are accepted."""

    method: Literal["gcc", "gcc_phat", "ml", "amdf"] = "gcc"
    """Cross-correlation, cross-correlation with whitened spectrum, maximum likelihood
    that starts from the latter, or the papers' AMDF."""
    low_hz: Frequency = 300.0
    """Lower end of the band, Hz."""
    high_hz: float = Field(default=15_000.0, ge=1.0, le=SAMPLE_RATE_HZ / 2)
    """Upper end of the band, Hz."""
    band: Literal["set", "found"] = "set"
    """Use the whole band, or the part of it that the sound of each frame occupies."""
    sound_speed_m_s: SoundSpeed | None = None
    """Speed of sound that the estimator assumes, m/s; unset: the true one."""
    false_alarm_rate: float = Field(default=1e-7, gt=0.0, lt=1.0)
    """Greatest share of frames of steady noise in which a sound is detected."""
    suppress_echoes: bool = True
    """Weigh frames with echoes by the precedence of the first wave front."""
    maximum_closure_s: Duration = 5e-6
    """Largest disagreement of a pair's own delay with those of all pairs, s."""
    maximum_misfit: Fraction = 0.05
    """Largest disagreement of a delay with the delay of the estimated position beyond
    ``maximum_closure_s``, as a share of the longest delay across the array. It has an
    effect with four microphones or more."""
    maximum_ambiguity: Fraction = 0.8
    """Largest second peak over the first one."""
    maximum_bearing_std_deg: Positive = 3.0
    """Largest standard deviation of a bearing, deg."""
    maximum_relative_range_std: Positive = 0.25
    """A range is valid where its standard deviation is below this share."""
    schedule_known: bool = False
    """Hear nothing in frames that cannot contain the source's sound by its schedule:
    this distinguishes sources that take turns, and a robot's own loudspeaker."""
    choose: Literal["loudest", "followed"] = "loudest"
    """Which of several overlapping sounds it hears: the loudest, or the one that it has
    followed until now."""
    first_bearing_deg: Angle | None = None
    """Bearing of the source to follow, from the microphones' centroid at the robot's
    start, deg CCW; unset: the first source that is heard alone. For ``choose:
    followed``."""

    @model_validator(mode="after")
    def _check(self) -> TDOAParameters:
        if self.low_hz >= self.high_hz:
            raise InputError(
                "low_hz", f"{self.low_hz:g} must be below high_hz = {self.high_hz:g}"
            )
        if self.first_bearing_deg is not None and self.choose == "loudest":
            raise InputError(
                "first_bearing_deg",
                "has no effect with choose: loudest; set choose to followed, or "
                "leave the bearing out",
            )
        return self


class CrossPowerParameters(Parameters):
    """How cross-power spectra become a bearing."""

    method: Literal["srp_near", "gcc_plane", "gcc_si"] = "srp_near"
    """``srp_near``: steers all pairs to near and far positions; ``gcc_plane``: delays
    of all pairs with sub-sample resolution, and a position where it is reliable, else a
    plane wave; ``gcc_si``: whole samples, three pairs and spherical interpolation, as
    printed."""
    low_hz: Frequency = 200.0
    """Lower edge of the band, Hz (Song 2011, 4.3)."""
    high_hz: Frequency = 8_000.0
    """Upper edge, Hz (4.3)."""
    noise_cross_power: bool = True
    """Whether the cross powers of the noise, measured before, are subtracted (4.3)."""
    ambiguous_share: Fraction = 0.9
    """Another direction counts as equally good if its response is this share of the
    strongest."""


class TrackerParameters(Parameters):
    """How the target is tracked."""

    hold: Literal["world", "robot", "motion"] = "motion"
    """Between bursts the target rests in W, moves with the robot, or goes on
    with its own velocity, which fades."""
    maximum_age_s: Duration = 6.0
    """An older target is lost: three periods of the sound, s."""
    assumed_range_m: Length = 3.0
    """Range of the first target when only its bearing is known, m."""
    resolve_front_back: bool = True
    """Let the robot's motion distinguish the source from its mirror image behind a row
    of microphones; off: every source is in front."""
    source_top_speed_m_s: Speed = 0.7
    """Speed of a fast source, m/s: two standard deviations of each component of an
    unknown velocity."""
    velocity_fade_s: Duration = 5.0
    """Time constant with which a source's velocity is forgotten, s."""
    measurement_floor_m: NonNegativeLength = 0.01
    """Standard deviation of errors that the covariance of an estimate does not include,
    m."""
    gate_floor_m: Length = 0.2
    """Standard deviation that the gate allows for in addition to the covariances, m."""
    believed_outliers: int = Field(default=3, ge=1, le=1_000)
    """Number of outliers in a row after which they are accepted, if they agree."""


class IdealHearingParameters(Parameters):
    """Imperfections of ideal hearing."""

    burst_gaps: bool = True
    """Whether it hears only while the source sounds; off: it hears at every tick."""
    bearing_noise_deg: NonNegative = 0.0
    """Standard deviation of a bearing, deg."""
    range_noise_fraction: NonNegative = 0.0
    """Standard deviation of a range over the range."""
    maximum_range_m: Length = 30.0
    """A source beyond it is not heard, m."""
