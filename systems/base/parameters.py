"""Parameters of motors, tyres and wheel encoders."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, Strict

from systems.framework.parameters import (
    Duration,
    Parameters,
)

_Slip = Annotated[float, Field(gt=-1.0, lt=1.0)]


class PlantParameters(Parameters):
    """Motors and contact of the wheels."""

    motor_lag_s: Duration = 0.05
    """Time constant of each wheel's speed loop, s; not printed, our choice."""
    slip: Annotated[tuple[_Slip, _Slip], Strict(False)] = (0.0, 0.0)
    """Part of the left and right rim speed that is lost, unseen by the encoders;
    negative: the wheel is larger than ``wheel_radius_m`` by this share."""
    friction: Annotated[float, Field(ge=1e-3, le=100.0)] | None = None
    """Coefficient of friction between tires and floor: the wheels slip where motion
    would need more force than this share of the weight. None: they never slip."""


class OdometryParameters(Parameters):
    """Wheel encoders (Han 2019, 4.1)."""

    pulses_per_revolution: int = Field(default=2600, gt=0, le=10_000_000)
    """Encoder pulses per wheel revolution."""
    rounding: bool = True
    """Angles in whole pulses; off: exact angles, as linearization needs."""
    lost_at_s: Duration | None = None
    """A fault: at this time odometry restarts at (0, 0, 0), s; none: never."""
