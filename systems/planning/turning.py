"""Forward speed and yaw rate that turn a robot to a wanted heading."""

from __future__ import annotations

import math
from typing import Any

from numba.extending import register_jitable

#: If the heading error is larger, the robot turns before it drives, rad.
_TURN_FIRST_RAD = 1.0


@register_jitable
def wrapped(angle: float) -> float:
    """Returns the same angle in the range from -pi to pi, rad."""
    return (angle + math.pi) % math.tau - math.pi


@register_jitable
def turn_towards(
    speed: float, heading: float, theta: float, own: Any
) -> tuple[float, float]:
    """Turns to a heading while driving; with a large heading error it only turns.

    Args:
        speed: Wanted speed, m/s.
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
