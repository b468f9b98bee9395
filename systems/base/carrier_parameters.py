"""Path, drive, and size of a robot that carries a loudspeaker."""

from __future__ import annotations

import math
from functools import lru_cache

from pydantic import model_validator

from systems.base.driven_path import DrivenPath
from systems.base.robot import RobotParameters
from systems.framework.input_error import InputError
from systems.framework.parameters import (
    Acceleration,
    Angle,
    Length,
    Mass,
    NonNegativeSpeed,
    Parameters,
    Positive,
    Speed,
    Time,
    Waypoints,
)
from systems.world.paths import ACCELERATION_M_S2, AtEnd, WaypointPath

#: Least ratio of the wheels' acceleration to the acceleration along the path. It is
#: above 1 because commands are held for a tick (half a motor lag), and because the
#: feedback needs a reserve.
_HEADROOM = 1.5

#: Angle by which the robot turns while its yaw rate rises in a corner, rad.
_TURN_IN_RAD = 0.08


class CarrierParameters(Parameters):
    """Path and drive of a robot that carries a loudspeaker (Han 2019, table 5)."""

    waypoints_m: Waypoints = ((2.0, 0.0),)
    """Waypoints in W, m. With one waypoint the source is at rest."""
    speed_m_s: NonNegativeSpeed = 0.3
    """Speed along the path, m/s (Han 2019, 5.3)."""
    acceleration_m_s2: Acceleration = ACCELERATION_M_S2
    """Acceleration along the path, m/s^2."""
    corner_radius_m: Length = 0.3
    """Largest radius of the rounded corners, m."""
    start_time_s: Time = 0.0
    """Time until which the source rests at its first waypoint, s."""
    at_end: AtEnd = "stop"
    """Behavior at the last waypoint: ``stop`` rests there, ``shuttle`` goes back and
    forth."""
    wheel_radius_m: Length = 0.06
    """Radius of the driven wheels, m."""
    wheel_separation_m: Length = 0.29
    """Distance between the driven wheels, m."""
    mass_kg: Mass = 5.3
    """Mass, kg."""
    wheel_force_n: Positive = 5.3
    """Largest force of each motor at its wheel's rim, N. Force and mass limit the
    acceleration of the wheels (2 m/s^2 by default)."""
    top_speed_m_s: Speed = 1.0
    """Limit of each wheel's rim speed, m/s."""

    @model_validator(mode="after")
    def _check_path(self) -> CarrierParameters:
        rim = self.speed_m_s + 0.5 * self.wheel_separation_m * self.top_yaw_rate
        if rim > self.top_speed_m_s:
            raise InputError(
                "speed_m_s",
                f"at {self.speed_m_s:g} m/s corners need wheels that reach "
                f"{rim:.3g} m/s, not {self.top_speed_m_s:g} m/s; lower it, or raise "
                "top_speed_m_s",
            )
        if self.acceleration_m_s2 * _HEADROOM > self.wheel_acceleration_m_s2:
            raise InputError(
                "acceleration_m_s2",
                f"{self.acceleration_m_s2:g} m/s^2 is too much for "
                f"wheels that reach {self.wheel_acceleration_m_s2:g} m/s^2, which must "
                f"be {_HEADROOM:g} times as much; lower it, or raise wheel_force_n",
            )
        self.plan()
        return self

    @property
    def wheel_acceleration_m_s2(self) -> float:
        """Limit of the acceleration of each wheel's rim, m/s^2.

        Straight ahead, both wheels accelerate by 2 F/m. In a turn the limit is about
        the same. The reason is that the moment of inertia of the body is about that of
        two point masses at the wheels, each half of the mass of the body.
        """
        return 2.0 * self.wheel_force_n / self.mass_kg

    @property
    def top_yaw_rate(self) -> float:
        """Top yaw rate in corners, rad/s.

        The robot accelerates to this yaw rate while it turns by 0.08 rad.
        """
        yaw_acceleration = 2.0 * self.wheel_acceleration_m_s2 / self.wheel_separation_m
        return math.sqrt(2.0 * _TURN_IN_RAD * yaw_acceleration)

    @property
    def rest_heading(self) -> float:
        """Heading of a carrier with one waypoint, rad."""
        return 0.0

    def path(self) -> DrivenPath:
        """Returns the driven motion as a function of time."""
        return driven_path(self)

    def plan(self) -> WaypointPath:
        """Returns the planned motion, which starts at time 0."""
        return WaypointPath(
            self.waypoints_m,
            speed=self.speed_m_s,
            acceleration=self.acceleration_m_s2,
            corner_radius=self.corner_radius_m,
            at_end=self.at_end,
            heading=self.rest_heading,
            top_yaw_rate=self.top_yaw_rate,
        )


class SourceRobotParameters(CarrierParameters):
    """Path, drive, and size of the leader robot (Han 2019, 5.3 and table 5)."""

    heading_deg: Angle = 0.0
    """Heading of a source at rest, deg CCW from the x axis of W."""
    length_m: Length = 0.326
    """Extent of the body along its direction of travel, m."""
    width_m: Length = 0.352
    """Extent of the body across its direction of travel, m."""

    @property
    def rest_heading(self) -> float:
        """Heading of a carrier with one waypoint, rad."""
        return math.radians(self.heading_deg)


@lru_cache(maxsize=16)
def driven_path(carrier: CarrierParameters) -> DrivenPath:
    """Returns the driven motion of a carrier.

    The cache keeps the motions of the last 16 carriers. A run and the runs of a sweep
    use the same carrier many times.

    Args:
        carrier: Parameters of the carrier.

    Returns:
        The motion. Equal parameters give the same object.
    """
    robot = RobotParameters(
        wheel_radius_m=carrier.wheel_radius_m,
        wheel_separation_m=carrier.wheel_separation_m,
        mass_kg=carrier.mass_kg,
        top_speed_m_s=carrier.top_speed_m_s,
    )
    return DrivenPath(
        carrier.plan(),
        robot,
        wheel_acceleration_m_s2=carrier.wheel_acceleration_m_s2,
        start_time_s=carrier.start_time_s,
        stops=carrier.at_end == "stop",
    )
