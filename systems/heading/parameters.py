"""Parameters of the compass and the motor driver."""

from __future__ import annotations

from pydantic import Field

from systems.framework.parameters import Parameters, Speed


class CompassParameters(Parameters):
    """Noise of the compass. The paper prints no value."""

    noise_deg: float = Field(default=0.5, ge=0.0, le=90.0)
    """Standard deviation of the measured heading, deg."""


class MotorDriverParameters(Parameters):
    """Wheel speed at full duty."""

    full_speed_m_s: Speed = 0.2
    """Rim speed of a wheel at full duty, m/s (Song 2011, 2.3.2: 10 to 20 cm/s)."""
