"""Parameters of the estimator and of the tracker."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, Strict, model_validator

from systems.framework.input_error import InputError
from systems.framework.parameters import (
    Angle,
    Duration,
    Parameters,
)
from systems.framework.signals import SAMPLE_RATE_HZ

_Edge = Annotated[float, Field(ge=1.0, le=SAMPLE_RATE_HZ / 2)]
#: Band that the estimator uses by default, Hz.
_BAND_HZ = (300.0, 15_000.0)


class TDOAParameters(Parameters):
    """Parameters of the measurement of delays, and of the acceptance of delays."""

    method: Literal["gcc", "gcc_phat", "ml", "amdf"] = "gcc"
    """Method that measures delays. ``gcc``: cross-correlation. ``gcc_phat``:
    cross-correlation of the whitened spectrum. ``ml``: maximum likelihood, started from
    cross-correlation. ``amdf``: the average magnitude difference function of the
    papers."""
    band_hz: Annotated[tuple[_Edge, _Edge], Strict(False)] | Literal["found"] = _BAND_HZ
    """Lower and upper end of the band that is used, Hz. ``found``: the part of the
    default band that the sound of each frame occupies."""
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
        low, high = self.limits_hz
        if low >= high:
            raise InputError("band_hz", f"{low:g} must be below {high:g}")
        if self.first_bearing_deg is not None and self.choose == "loudest":
            raise InputError(
                "first_bearing_deg",
                "has no effect with choose: loudest; set choose to followed, or "
                "leave the bearing out",
            )
        return self

    @property
    def limits_hz(self) -> tuple[float, float]:
        """Lower and upper end of the band, or of the band to search, Hz."""
        return _BAND_HZ if self.band_hz == "found" else self.band_hz


class TrackerParameters(Parameters):
    """How the position of the source is tracked."""

    hold: Literal["world", "robot", "motion"] = "motion"
    """Motion of the target between bursts of sound. ``world``: the target stays at its
    place in the world frame W. ``robot``: the target moves with the robot. ``motion``:
    the target moves on with its own velocity, which fades."""
    maximum_age_s: Duration = 6.0
    """Longest time since the target was last heard, s. After a longer time, the target
    counts as lost. The default is three periods of the sound."""
