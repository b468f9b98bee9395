"""Parameters of the estimators, the tracker and ideal hearing."""

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
    Speed,
)
from systems.framework.signals import SAMPLE_RATE_HZ


class TDOAParameters(Parameters):
    """How delays are measured and when they are accepted."""

    method: Literal["gcc", "gcc_phat", "ml", "amdf"] = "gcc"
    """How delays are measured. ``gcc``: cross-correlation. ``gcc_phat``:
    cross-correlation of the whitened spectrum. ``ml``: maximum likelihood, started from
    cross-correlation. ``amdf``: the average magnitude difference function of the
    papers."""
    low_hz: Frequency = 300.0
    """Lower end of the band, Hz."""
    high_hz: float = Field(default=15_000.0, ge=1.0, le=SAMPLE_RATE_HZ / 2)
    """Upper end of the band, Hz."""
    band: Literal["set", "found"] = "set"
    """``set``: use the whole band. ``found``: use the part of the band that the sound
    of each frame occupies."""
    false_alarm_rate: float = Field(default=1e-7, gt=0.0, lt=1.0)
    """Largest share of frames of steady noise in which a sound is detected by
    mistake."""
    suppress_echoes: bool = True
    """Whether to suppress echoes in favor of the first wave front."""
    maximum_closure_s: Duration = 5e-6
    """Largest disagreement between the delay of a pair and the delays of all pairs,
    s."""
    maximum_misfit: Fraction = 0.05
    """Largest difference between a measured delay and the delay of the estimated
    position, as a share of the longest delay across the array. ``maximum_closure_s`` is
    added to this limit. The limit has an effect only if there are more delays than
    unknowns, for example with four or more microphones in a row."""
    maximum_ambiguity: Fraction = 0.8
    """Largest ratio of the second peak of a correlation to its highest peak."""
    maximum_bearing_std_deg: Positive = 3.0
    """Largest standard deviation of a bearing, deg."""
    maximum_relative_range_std: Positive = 0.25
    """Largest standard deviation of a range, as a share of the range. If the standard
    deviation is larger, only the bearing is used."""
    schedule_known: bool = False
    """Whether the estimator knows the schedule of the source. The estimator then
    ignores frames that cannot contain sound of the source. This separates the source
    from sources that sound at other times, and from the robot's own loudspeaker."""
    choose: Literal["loudest", "followed"] = "loudest"
    """Which of several overlapping sounds to use. ``loudest``: the loudest sound.
    ``followed``: the sound of the source that was followed so far."""
    first_bearing_deg: Angle | None = None
    """Bearing of the source to follow, seen from the centroid of the microphones at the
    start, deg CCW. Unset: the first source that is heard alone. It requires ``choose:
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
    """How cross-power spectra are converted to a bearing."""

    method: Literal["srp_near", "gcc_plane", "gcc_si"] = "srp_near"
    """``srp_near`` steers all pairs to near and far positions. ``gcc_plane`` uses the
    delays of all pairs with sub-sample resolution. It fits a position if that is
    reliable, and otherwise a plane wave. ``gcc_si`` is the method printed in Song 2011:
    whole samples, pairs with the middle microphone, and spherical interpolation."""
    low_hz: Frequency = 200.0
    """Lower edge of the band, Hz (Song 2011, 4.3)."""
    high_hz: Frequency = 8_000.0
    """Upper edge of the band, Hz (Song 2011, 4.3)."""
    noise_cross_power: bool = True
    """Whether to subtract the cross powers of the noise, which are measured before the
    sound (Song 2011, 4.3)."""
    ambiguous_share: Fraction = 0.9
    """The result is ambiguous if the response of another direction is at least this
    share of the strongest response."""


class TrackerParameters(Parameters):
    """How the position of the source is tracked."""

    hold: Literal["world", "robot", "motion"] = "motion"
    """What the target does between bursts. ``world``: it stays at its place in W.
    ``robot``: it moves with the robot. ``motion``: it moves on with its own velocity,
    which fades."""
    maximum_age_s: Duration = 6.0
    """Longest time since the target was last heard, s. After a longer time, the target
    is lost. The default is three periods of the sound."""
    assumed_range_m: Length = 3.0
    """Assumed range of the first target when only its bearing is known, m."""
    resolve_front_back: bool = True
    """Whether the motion of the robot distinguishes the source from its mirror image
    behind a row of microphones. Off: every source is in front."""
    source_top_speed_m_s: Speed = 0.7
    """Speed of a fast source, m/s. It is two standard deviations of each component of
    an unknown velocity."""
    velocity_fade_s: Duration = 5.0
    """Time constant with which the velocity of a source is forgotten, s."""
    measurement_floor_m: NonNegativeLength = 0.01
    """Standard deviation of errors that are not in the covariance of an estimate, m."""
    gate_floor_m: Length = 0.2
    """Standard deviation that is added to the covariances in the test for outliers,
    m."""
    believed_outliers: int = Field(default=3, ge=1, le=1_000)
    """Number of consecutive outliers that are accepted if they agree with each
    other."""


class IdealHearingParameters(Parameters):
    """Imperfections of ideal hearing."""

    burst_gaps: bool = True
    """Whether the sensor hears only while the source sounds. Off: it hears in every
    tick."""
    bearing_noise_deg: NonNegative = 0.0
    """Standard deviation of a bearing, deg."""
    range_noise_fraction: NonNegative = 0.0
    """Standard deviation of a range, as a share of the range."""
    maximum_range_m: Length = 30.0
    """Largest distance at which a source is heard, m."""
