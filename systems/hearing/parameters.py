"""Parameters of the estimators, the tracker and ideal hearing."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

from systems.framework.input_error import InputError
from systems.framework.parameters import (
    Angle,
    Duration,
    Frequency,
    NonNegative,
    Parameters,
)
from systems.framework.signals import SAMPLE_RATE_HZ


class TDOAParameters(Parameters):
    """Parameters of the measurement of delays, and of the acceptance of delays."""

    method: Literal["gcc", "gcc_phat", "ml", "amdf"] = "gcc"
    """Method that measures delays. ``gcc``: cross-correlation. ``gcc_phat``:
    cross-correlation of the whitened spectrum. ``ml``: maximum likelihood, started from
    cross-correlation. ``amdf``: the average magnitude difference function of the
    papers."""
    low_hz: Frequency = 300.0
    """Lower end of the band, Hz."""
    high_hz: float = Field(default=15_000.0, ge=1.0, le=SAMPLE_RATE_HZ / 2)
    """Upper end of the band, Hz."""
    band: Literal["set", "found"] = "set"
    """Part of the band to use. ``set``: the whole band. ``found``: the part of the band
    that the sound of each frame occupies."""
    false_alarm_rate: float = Field(default=1e-7, gt=0.0, lt=1.0)
    """Largest share of frames of steady noise in which a sound is detected by
    mistake."""
    suppress_echoes: bool = True
    """Whether to suppress echoes in favor of the first wave front."""
    schedule_known: bool = False
    """Whether the estimator knows the schedule of the source. If so, it ignores frames
    that cannot contain sound of the source. It then does not hear sources that sound at
    other times, or the robot's own loudspeaker."""
    choose: Literal["loudest", "followed"] = "loudest"
    """Choice of the sound if several sounds overlap. ``loudest``: the loudest sound.
    ``followed``: the sound of the source that the robot has followed so far."""
    first_bearing_deg: Angle | None = None
    """Bearing of the source to follow at the start, deg CCW, seen from the centroid of
    the microphones. Unset: the robot follows the first source that it hears alone. The
    field requires ``choose: followed``."""

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


class TrackerParameters(Parameters):
    """How the position of the source is tracked."""

    hold: Literal["world", "robot", "motion"] = "motion"
    """Motion of the target between bursts of sound. ``world``: the target stays at its
    place in the world frame W. ``robot``: the target moves with the robot. ``motion``:
    the target moves on with its own velocity, which fades."""
    maximum_age_s: Duration = 6.0
    """Longest time since the target was last heard, s. After a longer time, the target
    counts as lost. The default is three periods of the sound."""


class IdealHearingParameters(Parameters):
    """Imperfections of ideal hearing."""

    burst_gaps: bool = True
    """Whether the sensor hears only while the source sounds. Off: the sensor hears in
    every control period."""
    bearing_noise_deg: NonNegative = 0.0
    """Standard deviation of a bearing, deg."""
    range_noise_fraction: NonNegative = 0.0
    """Standard deviation of a range, as a share of the range."""
