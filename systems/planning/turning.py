"""Forward speed and yaw rate that turn a robot to a wanted heading."""

from __future__ import annotations

import math
from typing import Any

from numba.extending import register_jitable

#: If the heading error is larger than this angle, rad, the robot turns before it
#: drives.
_TURN_FIRST_RAD = 1.0


@register_jitable
def wrapped(angle: float) -> float:
    """Returns the same angle in the range from -pi to pi, rad."""
    return (angle + math.pi) % math.tau - math.pi


@register_jitable
def turn_towards(
    speed: float, heading: float, theta: float, own: Any
) -> tuple[float, float]:
    """Computes the motion that turns a robot to a heading while it drives.

    Args:
        speed: Wanted speed, m/s. If the heading error is large, forward speeds are
            reduced to 0.
        heading: Wanted heading in W, rad.
        theta: Heading of the robot in W, rad.
        own: ``FollowingParameters``.

    Returns:
        Forward speed, m/s, and yaw rate, rad/s.
    """
    error = wrapped(heading - theta)
    limit = own.turn_rate_rad_s
    turn = min(max(own.turn_gain * error, -limit), limit)
    if speed > 0.0:
        speed *= math.cos(error) if abs(error) < _TURN_FIRST_RAD else 0.0
    return speed, turn
