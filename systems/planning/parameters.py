"""Parameters of following and of the safety filter."""

from __future__ import annotations

from pydantic import Field

from systems.framework.parameters import (
    NonNegativeLength,
    NonNegativeSpeed,
    Parameters,
    Positive,
    Speed,
)


class SafetyFilterParameters(Parameters):
    """Distances that the filter keeps; all values are our choice."""

    margin_m: NonNegativeLength = 0.05
    """Distance kept between objects and the disc about the axle that contains the body,
    m."""
    approach_rate: float = Field(default=1.0, ge=1e-3, le=100.0)
    """alpha, 1/s: share of the distance to an obstacle at rest by which P may approach
    per second."""
    horizon_s: float = Field(default=4.0, ge=0.1, le=60.0)
    """Contacts with moving objects count if they are nearer in time than this, s."""


class FollowingParameters(Parameters):
    """How a law that commands motions instead of forces follows and turns."""

    cruise_speed_m_s: Speed = 0.62
    """Largest wanted speed, m/s."""
    back_speed_m_s: NonNegativeSpeed = 0.15
    """Speed of backing off, m/s."""
    approach_gain: Positive = 1.2
    """Wanted speed per distance to go, 1/s."""
    source_share: float = Field(default=0.8, ge=0.0, le=1.0)
    """Share of the target's own speed that is added."""
    turn_gain: Positive = 3.0
    """Yaw rate per error of the heading, 1/s."""
    turn_rate_rad_s: float = Field(default=2.0, gt=0.0, le=20.0)
    """Largest wanted yaw rate, rad/s."""
