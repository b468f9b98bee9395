"""Parameters of obstacles."""

from __future__ import annotations

import math

from pydantic import Field, model_validator

from systems.framework.parameters import (
    Acceleration,
    Angle,
    Length,
    Line,
    NonNegativeSpeed,
    Parameters,
    Size,
    Time,
    Waypoints,
)
from systems.world.paths import ACCELERATION_M_S2, AtEnd, WaypointPath


class ObstacleParameters(Parameters):
    """One box that is at rest or moves along waypoints."""

    name: Line = Field(default="obstacle", min_length=1)
    """Name in results and pictures."""
    size_m: Size = (0.1, 0.05)
    """Extents along the box's own x axis (its direction of travel) and y axis, m."""
    waypoints_m: Waypoints = ((2.0, 1.0),)
    """Waypoints of the center in W, m. With one waypoint the obstacle is at rest."""
    heading_deg: Angle = 0.0
    """Heading of an obstacle at rest, deg CCW from the x axis of W."""
    speed_m_s: NonNegativeSpeed = 0.3
    """Speed along the waypoints, m/s."""
    acceleration_m_s2: Acceleration = ACCELERATION_M_S2
    """Acceleration when starting and braking, m/s^2."""
    start_time_s: Time = 0.0
    """Time until which the obstacle rests at its first waypoint, s."""
    at_end: AtEnd = "stop"
    """Behavior at the last waypoint. ``stop``: the obstacle rests there. ``shuttle``:
    the obstacle goes back and forth."""
    known: bool = True
    """Whether the map for planned routes contains this obstacle. The map contains only
    obstacles at rest."""
    corner_radius_m: Length = 0.05
    """Largest radius of the rounded corners, m."""

    @model_validator(mode="after")
    def _check_path(self) -> ObstacleParameters:
        self.path()
        return self

    def path(self) -> WaypointPath:
        """Returns the path of the center as a function of time."""
        return WaypointPath(
            self.waypoints_m,
            speed=self.speed_m_s,
            acceleration=self.acceleration_m_s2,
            corner_radius=self.corner_radius_m,
            start_time=self.start_time_s,
            at_end=self.at_end,
            heading=math.radians(self.heading_deg),
        )
