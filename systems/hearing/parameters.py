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
    SoundSpeed,
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
    sound_speed_m_s: SoundSpeed | None = None
    """Speed of sound that the estimator assumes, m/s. Unset: the true speed of
    sound."""
    false_alarm_rate: float = Field(default=1e-7, gt=0.0, lt=1.0)
    """Largest share of frames of steady noise in which a sound is detected by
    mistake."""
    suppress_echoes: bool = True
    """Whether to suppress echoes in favor of the first wave front."""
    maximum_closure_s: Duration = 5e-6
    """Largest disagreement between the delay of a pair and the delays of all pairs,
    s."""
    maximum_misfit: Fraction = 0.05
    """Largest misfit of a delay to the estimated position, in addition to
    ``maximum_closure_s``, as a share of the longest delay across the array. It has an
    effect only with more delays than unknowns: four microphones in a row or more."""
    maximum_ambiguity: Fraction = 0.8
    """Largest ratio of the second to the first peak of a correlation."""
    maximum_bearing_std_deg: Positive = 3.0
    """Largest standard deviation of a bearing, deg."""
    maximum_relative_range_std: Positive = 0.25
    """Largest standard deviation of a range, as a share of the range. Above it, only
    the bearing is used."""
    schedule_known: bool = False
    """Whether the estimator ignores frames that cannot contain sound of the source by
    its schedule. This separates sources that take turns, and the robot's own
    loudspeaker."""
    choose: Literal["loudest", "followed"] = "loudest"
    """Which of several overlapping sounds to use: the loudest, or that of the source
    that was followed so far."""
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
    delays of all pairs with sub-sample resolution. It fits a position where that is
    reliable, otherwise a plane wave. ``gcc_si`` is the printed method: whole samples,
    pairs with the middle microphone, and spherical interpolation."""
    low_hz: Frequency = 200.0
    """Lower edge of the band, Hz (Song 2011, 4.3)."""
    high_hz: Frequency = 8_000.0
    """Upper edge of the band, Hz (Song 2011, 4.3)."""
    noise_cross_power: bool = True
    """Whether to subtract the cross powers of the noise, measured before (Song 2011,
    4.3)."""
    ambiguous_share: Fraction = 0.9
    """Another direction makes the result ambiguous if its response is at least this
    share of the strongest."""


class TrackerParameters(Parameters):
    """How the position of the source is tracked."""

    hold: Literal["world", "robot", "motion"] = "motion"
    """What the target does between bursts. ``world``: it stays at its place in W.
    ``robot``: it moves with the robot. ``motion``: it moves on with its own velocity,
    which fades."""
    maximum_age_s: Duration = 6.0
    """A target that was not heard for longer than this is lost, s. The default is three
    periods of the sound."""
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
    """Standard deviation that the gate adds to the covariances, m."""
    believed_outliers: int = Field(default=3, ge=1, le=1_000)
    """Number of consecutive outliers after which they are accepted if they agree."""


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
