"""Path and size of the robot that carries the loudspeaker, and limits of its drive."""

from __future__ import annotations

import math
from functools import lru_cache

from pydantic import model_validator

from systems.base.driven_path import DrivenPath
from systems.base.source_drive import (
    TOP_SPEED_M_S,
    WHEEL_ACCELERATION_M_S2,
    WHEEL_SEPARATION_M,
)
from systems.framework.input_error import InputError
from systems.framework.parameters import (
    Acceleration,
    Angle,
    Length,
    NonNegativeSpeed,
    Parameters,
    Time,
    Times,
    Waypoints,
)
from systems.world.parameters import SPEED_M_S, check_stated_times
from systems.world.path_motion import AtEnd
from systems.world.paths import ACCELERATION_M_S2, WaypointPath

#: Least ratio of the wheels' acceleration to the acceleration along the path. The ratio
#: is above 1 for two reasons. Commands are held for a control period (half a motor
#: lag). The feedback needs a reserve.
_HEADROOM = 1.5

#: Angle by which the robot turns while its yaw rate rises in a corner, rad.
_TURN_IN_RAD = 0.08

#: Top yaw rate in corners, rad/s. The robot accelerates to it within ``_TURN_IN_RAD``.
_TOP_YAW_RATE = math.sqrt(
    2.0 * _TURN_IN_RAD * (2.0 * WHEEL_ACCELERATION_M_S2 / WHEEL_SEPARATION_M)
)

#: Greatest speed along the path, m/s. The outer wheel is faster in a corner.
_TOP_SPEED_M_S = TOP_SPEED_M_S - 0.5 * WHEEL_SEPARATION_M * _TOP_YAW_RATE


class SourceRobotParameters(Parameters):
    """Path and size of the leader robot (Han 2019, 5.3 and table 5)."""

    waypoints_m: Waypoints = ((2.0, 0.0),)
    """Waypoints in W, m. With one waypoint the source is at rest."""
    speed_m_s: NonNegativeSpeed = SPEED_M_S
    """Speed along the path, m/s (Han 2019, 5.3)."""
    acceleration_m_s2: Acceleration = ACCELERATION_M_S2
    """Acceleration along the path, m/s^2."""
    corner_radius_m: Length = 0.3
    """Largest radius of the rounded corners, m."""
    start_time_s: Time = 0.0
    """Time until which the source rests at its first waypoint, s."""
    at_end: AtEnd = "stop"
    """Behavior at the last waypoint. ``stop``: the robot rests there. ``shuttle``: the
    robot goes back and forth. ``loop``: the robot drives on to the first waypoint, and
    repeats this closed path for ever."""
    pauses_s: Times = ()
    """Pause at each waypoint, s, for example [0, 2.5, 0]. At a waypoint with a pause,
    the robot stops and turns on the spot. Empty: no pauses."""
    waypoint_times_s: Times = ()
    """Time at which the robot reaches each waypoint, s, for example [0, 4, 9]. The
    times replace ``speed_m_s`` and ``start_time_s``. Empty: it drives at
    ``speed_m_s``."""
    heading_deg: Angle = 0.0
    """Heading of a source at rest, deg CCW from the x axis of W."""
    length_m: Length = 0.326
    """Extent of the body along its direction of travel, m."""
    width_m: Length = 0.352
    """Extent of the body across its direction of travel, m."""

    @model_validator(mode="after")
    def _check_path(self) -> SourceRobotParameters:
        check_stated_times(self.waypoint_times_s, self.speed_m_s, self.start_time_s)
        if self.speed_m_s > _TOP_SPEED_M_S:
            rim = TOP_SPEED_M_S - _TOP_SPEED_M_S + self.speed_m_s
            raise InputError(
                "speed_m_s",
                f"at {self.speed_m_s:g} m/s corners need wheels that reach "
                f"{rim:.3g} m/s, not {TOP_SPEED_M_S:g} m/s; lower it",
            )
        if self.acceleration_m_s2 * _HEADROOM > WHEEL_ACCELERATION_M_S2:
            raise InputError(
                "acceleration_m_s2",
                f"{self.acceleration_m_s2:g} m/s^2 is too much for "
                f"wheels that reach {WHEEL_ACCELERATION_M_S2:g} m/s^2, which must "
                f"be {_HEADROOM:g} times as much; lower it",
            )
        self.plan()
        return self

    def path(self) -> DrivenPath:
        """Returns the driven motion as a function of time."""
        return driven_path(self)

    def plan(self) -> WaypointPath:
        """Returns the planned motion, which starts at time 0."""
        return WaypointPath(
            self.waypoints_m,
            speed=_TOP_SPEED_M_S if self.waypoint_times_s else self.speed_m_s,
            acceleration=self.acceleration_m_s2,
            corner_radius=self.corner_radius_m,
            at_end=self.at_end,
            heading=math.radians(self.heading_deg),
            top_yaw_rate=_TOP_YAW_RATE,
            pauses=self.pauses_s,
            times=self.waypoint_times_s,
        )


@lru_cache(maxsize=16)
def driven_path(source: SourceRobotParameters) -> DrivenPath:
    """Returns the motion of a leader robot, which carries the sound source.

    Equal parameters give the same object. A cache keeps the motions of the last 16
    leaders, because many runs use the same motion.
    """
    return DrivenPath(
        source.plan(),
        start_time_s=source.start_time_s,
        stops=source.at_end == "stop",
    )
