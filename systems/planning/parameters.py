"""Parameters of following."""

from __future__ import annotations

from pydantic import Field

from systems.framework.parameters import (
    NonNegativeSpeed,
    Parameters,
    Positive,
    Speed,
)


class FollowingParameters(Parameters):
    """Following and turning of laws that command motions instead of forces."""

    cruise_speed_m_s: Speed = 0.62
    """Largest wanted speed, m/s."""
    back_speed_m_s: NonNegativeSpeed = 0.15
    """Speed of backing off, m/s."""
    approach_gain: Positive = 1.2
    """Wanted speed per remaining distance, 1/s."""
    source_share: float = Field(default=0.8, ge=0.0, le=1.0)
    """Share of the target's speed that is added to the wanted speed."""
    turn_gain: Positive = 3.0
    """Yaw rate per error of the heading, 1/s."""
    turn_rate_rad_s: float = Field(default=2.0, gt=0.0, le=20.0)
    """Largest wanted yaw rate, rad/s."""
