"""From a heading that is wanted to a twist."""

from __future__ import annotations

import math
from typing import Any

from numba.extending import register_jitable

#: Farther off its heading than this, the robot turns before it drives, rad.
_TURN_FIRST_RAD = 1.0


@register_jitable
def wrapped(angle: float) -> float:
    """The same angle from -pi to pi, rad."""
    return (angle + math.pi) % math.tau - math.pi


@register_jitable
def turn_towards(
    speed: float, heading: float, theta: float, own: Any
) -> tuple[float, float]:
    """Turns to a heading while it drives; far off it turns first.

    Args:
        speed: Wanted, m/s.
        heading: Wanted, in W, rad.
        theta: Of the robot, in W, rad.
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
