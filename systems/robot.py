"""Dimensions of the sound-following robot, shared by several blocks."""

from __future__ import annotations

from systems.parameters import Parameters, Positive

__all__ = ["RobotParameters"]


class RobotParameters(Parameters):
    """The slave robot of Han 2019, table 6.

    The table prints "350 (W) x 820 (L)" beside a wheel distance of 410 mm and
    a microphone row of 800 mm, so that 820 mm can only be the lateral size.
    """

    length_m: Positive = 0.35
    """Extent of the body along its x axis, m."""
    width_m: Positive = 0.82
    """Extent of the body along its y axis, the microphone bar included, m."""
    control_point_m: Positive = 0.175
    """Distance epsilon of the control point P ahead of the axle, m."""
    microphone_spacing_m: Positive = 0.40
    """Distance l between neighbouring microphones, m (Han 2019, 2.3)."""
    wheel_radius_m: Positive = 0.06
    """Radius of the driven wheels, m."""
    wheel_separation_m: Positive = 0.41
    """Distance L between the driven wheels, m."""
    mass_kg: Positive = 3.94
    """Virtual mass M at P, kg: the mass of the robot."""
    top_speed_m_s: Positive = 0.72
    """Limit of |v_P| and of each wheel's rim speed, m/s (Han 2019, 5.3)."""

    @property
    def top_wheel_speed(self) -> float:
        """Largest wheel speed, rad/s."""
        return self.top_speed_m_s / self.wheel_radius_m
