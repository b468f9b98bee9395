"""How fast the robot should go to follow a target, and in which direction."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from numba.extending import register_jitable

from systems.planning.turning import TURN_RATE_RAD_S

#: Largest wanted speed, and speed of backing off, m/s.
CRUISE_SPEED_M_S, BACK_SPEED_M_S = 0.62, 0.15
#: Wanted speed per remaining distance, 1/s, and share of the target's speed that is
#: added to the wanted speed.
APPROACH_GAIN, SOURCE_SHARE = 1.2, 0.8
#: Least and largest speed, m/s, and largest yaw rate, rad/s, of laws that command
#: motions instead of forces.
SPEED_LIMITS = -BACK_SPEED_M_S, CRUISE_SPEED_M_S, TURN_RATE_RAD_S


class FollowNumbers(NamedTuple):
    """Constants of following."""

    distance_m: float
    """Distance that P should keep from the target, m."""
    control_point_m: float
    """Distance of P ahead of the axle, m."""


@register_jitable
def wanted_speed(left: float, along: float) -> float:
    """Computes the wanted speed.

    Args:
        left: Distance from the target minus the follow distance, m.
        along: Speed of the target in the direction of travel, m/s.

    Returns:
        Wanted speed, m/s. If it is negative, the robot backs off.
    """
    wanted = APPROACH_GAIN * left + SOURCE_SHARE * along
    return min(max(wanted, -BACK_SPEED_M_S), CRUISE_SPEED_M_S)


@register_jitable
def approach(inputs: Any, follow: FollowNumbers) -> tuple[float, float]:
    """Computes the speed of a straight approach to the target, and its direction.

    Args:
        inputs: Position and velocity of the target, m and m/s; whether there is a
            target; pose of the robot, m and rad. Further inputs are not read.
        follow: Constants of following.

    Returns:
        Wanted speed, m/s, and bearing of the target from the axle in W, rad. Without a
        target, the speed is 0 and the bearing is the heading of the robot.
    """
    target, velocity, valid, pose = inputs[0], inputs[1], inputs[2][0], inputs[3]
    if valid < 0.5:
        return 0.0, pose[2]
    dx, dy = target[0] - pose[0], target[1] - pose[1]
    bearing = math.atan2(dy, dx)
    px = dx - follow.control_point_m * math.cos(pose[2])
    py = dy - follow.control_point_m * math.sin(pose[2])
    along = velocity[0] * math.cos(bearing) + velocity[1] * math.sin(bearing)
    left = math.hypot(px, py) - follow.distance_m
    return wanted_speed(left, along), bearing
