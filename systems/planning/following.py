"""What following a target asks of a robot: how fast it should go, and where to."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from numba.extending import register_jitable

from systems.planning.parameters import FollowingParameters


class FollowNumbers(NamedTuple):
    """What following depends on."""

    own: FollowingParameters
    distance_m: float
    """At which P is to stay, m."""
    control_point_m: float
    """Distance of P ahead of the axle, m."""


@register_jitable
def wanted_speed(left: float, along: float, own: Any) -> float:
    """How fast to go.

    Args:
        left: Way to go to the follow distance, m.
        along: Speed of the target along it, m/s.
        own: ``FollowingParameters``.

    Returns:
        m/s; negative: back off.
    """
    wanted = own.approach_gain * left + own.source_share * along
    return min(max(wanted, -own.back_speed_m_s), own.cruise_speed_m_s)


@register_jitable
def approach(inputs: Any, follow: FollowNumbers) -> tuple[float, float]:
    """How fast to go straight to the target, and in which direction it is.

    Args:
        inputs: Place and velocity of the target, m and m/s, whether there is one, and
            pose of the robot, m and rad; more are not read.
        follow: How it follows.

    Returns:
        Wanted speed, m/s, 0 without a target, and bearing from the axle in W, rad.
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
    return wanted_speed(left, along, follow.own), bearing
