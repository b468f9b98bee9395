"""Parameters of obstacles, and checks of the motion of bodies."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pydantic import Field, model_validator

from systems.framework.input_error import InputError
from systems.framework.parameters import (
    Acceleration,
    Angle,
    Length,
    Line,
    NonNegativeSpeed,
    Parameters,
    Size,
    Time,
    Times,
    Waypoints,
)
from systems.world.path_motion import AtEnd
from systems.world.paths import ACCELERATION_M_S2, WaypointPath

#: Default speed of obstacles and of the leader, m/s (Han 2019, 5.3).
SPEED_M_S = 0.3
#: Greatest speed that an obstacle may need to keep the times of its waypoints, m/s. It
#: is the limit of the field ``speed_m_s``.
_TOP_SPEED_M_S = 100.0


def check_stated_times(
    times: Sequence[float], speed_m_s: float, start_time_s: float
) -> None:
    """Rejects fields that the times of waypoints replace.

    Args:
        times: Field ``waypoint_times_s``, s.
        speed_m_s: Field ``speed_m_s``, m/s.
        start_time_s: Field ``start_time_s``, s.

    Raises:
        InputError: The times are given, and another field does not have its default.
    """
    if times and speed_m_s != SPEED_M_S:
        raise InputError(
            "speed_m_s",
            f"{speed_m_s:g} m/s cannot hold with waypoint_times_s, which decides the "
            "speed; remove one of the two",
        )
    if times and start_time_s:
        raise InputError(
            "start_time_s",
            f"{start_time_s:g} s cannot hold with waypoint_times_s, whose first value "
            f"is the start; write {start_time_s:g} as its first value instead",
        )


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
    speed_m_s: NonNegativeSpeed = SPEED_M_S
    """Speed along the waypoints, m/s."""
    acceleration_m_s2: Acceleration = ACCELERATION_M_S2
    """Acceleration when starting and braking, m/s^2."""
    start_time_s: Time = 0.0
    """Time until which the obstacle rests at its first waypoint, s."""
    at_end: AtEnd = "stop"
    """Behavior at the last waypoint. ``stop``: the obstacle rests there. ``shuttle``:
    the obstacle goes back and forth. ``loop``: the obstacle drives on to the first
    waypoint, and repeats this closed path for ever."""
    pauses_s: Times = ()
    """Pause at each waypoint, s, for example [0, 2.5, 0]. At a waypoint with a pause,
    the obstacle stops and turns on the spot. Empty: no pauses."""
    waypoint_times_s: Times = ()
    """Time at which the obstacle reaches each waypoint, s, for example [0, 4, 9]. The
    times replace ``speed_m_s`` and ``start_time_s``. Empty: it drives at
    ``speed_m_s``."""
    known: bool = True
    """Whether the map for planned routes contains this obstacle. The map contains only
    obstacles at rest."""
    corner_radius_m: Length = 0.05
    """Largest radius of the rounded corners, m."""

    @model_validator(mode="after")
    def _check_path(self) -> ObstacleParameters:
        check_stated_times(self.waypoint_times_s, self.speed_m_s, self.start_time_s)
        self.path()
        return self

    def path(self) -> WaypointPath:
        """Returns the path of the center as a function of time."""
        return WaypointPath(
            self.waypoints_m,
            speed=_TOP_SPEED_M_S if self.waypoint_times_s else self.speed_m_s,
            acceleration=self.acceleration_m_s2,
            corner_radius=self.corner_radius_m,
            start_time=self.start_time_s,
            at_end=self.at_end,
            heading=math.radians(self.heading_deg),
            pauses=self.pauses_s,
            times=self.waypoint_times_s,
        )
