"""Computation of the speed and direction with which the robot follows a target."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from numba.extending import register_jitable

from systems.planning.turning import TURN_RATE_RAD_S

# ``CRUISE_SPEED_M_S``: largest wanted speed, m/s.
# ``BACK_SPEED_M_S``: largest speed of backing off, m/s.
CRUISE_SPEED_M_S, BACK_SPEED_M_S = 0.62, 0.15
# ``APPROACH_GAIN``: wanted speed per remaining distance, 1/s.
# ``SOURCE_SHARE``: share of the target's speed that is added to the wanted speed.
APPROACH_GAIN, SOURCE_SHARE = 1.2, 0.8
#: Limits of laws that command motions instead of forces: least speed, m/s, largest
#: speed, m/s, and largest yaw rate, rad/s.
SPEED_LIMITS = -BACK_SPEED_M_S, CRUISE_SPEED_M_S, TURN_RATE_RAD_S


class FollowNumbers(NamedTuple):
    """Constants for following a target."""

    distance_m: float
    """Distance that P should keep from the target, m."""
    control_point_m: float
    """Distance of P ahead of the axle, m."""


@register_jitable
def wanted_speed(left: float, along: float, cruise: float = CRUISE_SPEED_M_S) -> float:
    """Computes the speed with which the robot should approach the target.

    Args:
        left: Distance from the target minus the follow distance, m.
        along: Speed of the target in the direction of travel, m/s.
        cruise: Largest wanted speed, m/s.

    Returns:
        Wanted speed, m/s. At a negative speed, the robot backs off.
    """
    wanted = APPROACH_GAIN * left + SOURCE_SHARE * along
    return min(max(wanted, -BACK_SPEED_M_S), cruise)


@register_jitable
def left_to_target(target: Any, pose: Any, follow: FollowNumbers) -> float:
    """Computes the distance of P from the target minus the follow distance, m.

    ``target`` is a position (x, y), m, and ``pose`` is that of the robot, m and rad.
    """
    px = target[0] - pose[0] - follow.control_point_m * math.cos(pose[2])
    py = target[1] - pose[1] - follow.control_point_m * math.sin(pose[2])
    return math.hypot(px, py) - follow.distance_m


@register_jitable
def approach(inputs: Any, follow: FollowNumbers) -> tuple[float, float]:
    """Computes the speed and direction of a straight approach to the target.

    Args:
        inputs: Values of the input ports. The function reads four of them: position of
            the target, m; velocity of the target, m/s; whether there is a target; and
            pose of the robot, m and rad.
        follow: Constants for following a target.

    Returns:
        Wanted speed, m/s, and direction from the axle to the target in the world frame
        W, rad. If there is no target, the speed is 0 and the direction is the heading
        of the robot.
    """
    target, velocity, valid, pose = inputs[0], inputs[1], inputs[2][0], inputs[3]
    if valid < 0.5:
        return 0.0, pose[2]
    dx, dy = target[0] - pose[0], target[1] - pose[1]
    bearing = math.atan2(dy, dx)
    along = velocity[0] * math.cos(bearing) + velocity[1] * math.sin(bearing)
    return wanted_speed(left_to_target(target, pose, follow), along), bearing
