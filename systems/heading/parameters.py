"""Parameters of the compass, the heading controller and the motor driver."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, Strict

from systems.framework.parameters import Angle, NonNegative, Parameters, Positive, Speed

_Part = Annotated[float, Field(ge=-0.9, le=0.9)]

_Gain = Annotated[float, Field(ge=0.1, le=10.0)]


class CompassParameters(Parameters):
    """Direction of north and distortions of the field. The paper prints no values."""

    north_deg: Angle = 90.0
    """Direction of magnetic north in W, CCW from the x axis of W, deg."""
    hard_iron: Annotated[tuple[_Part, _Part], Strict(False)] = (0.0, 0.0)
    """Magnetic field of the robot along x and y of B, divided by the horizontal field
    of the earth. Fields of 0.02, 0.05 and 0.1 change the heading by up to 1.1, 2.9 and
    5.7 deg."""
    soft_iron: Annotated[tuple[_Gain, _Gain], Strict(False)] = (1.0, 1.0)
    """Factors of the field components along x and y of B."""
    noise_deg: float = Field(default=0.5, ge=0.0, le=90.0)
    """Standard deviation of the measured heading, deg."""


class HeadingControlParameters(Parameters):
    """Gains and limits (Song 2011, 2.3.2 and tables 1 and 2)."""

    proportional: NonNegative = 2.0
    """K_P, gain of the proportional part."""
    integral: NonNegative = 0.5
    """K_I, gain of the integral part, 1/s."""
    differential: NonNegative = 0.01
    """K_D, gain of the differential part, s."""
    integral_within_deg: NonNegative = 20.0
    """Deviation below which the integral part accumulates, deg. At larger deviations,
    the integral part is 0."""
    largest_integral_deg: NonNegative = 30.0
    """Limit of the integral part, deg."""
    largest_differential_deg: NonNegative = 20.0
    """Limit of the differential part, deg."""
    largest_error_deg: Positive = 100.0
    """Limit of the output, deg. The text states this limit, but table 1 does not."""
    turning_beyond_deg: Positive = 50.0
    """L, output beyond which the robot turns on the spot, deg."""
    pulse_widths: Literal["mended", "printed", "else_only"] = "mended"
    """Conversion of the output to duties. ``mended``: the duties change without a jump
    from full speed ahead to turning on the spot. ``printed``: table 2 as printed, with
    which the robot drives backward. ``else_only``: table 2 with only the missing
    ``else`` added."""


class MotorDriverParameters(Parameters):
    """Wheel speed at full duty."""

    full_speed_m_s: Speed = 0.2
    """Rim speed of a wheel at full duty, m/s (Song 2011, 2.3.2: 10 to 20 cm/s)."""
