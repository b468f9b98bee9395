"""Forward speed and yaw rate that turn a robot to a wanted heading."""

from __future__ import annotations

import math

from numba.extending import register_jitable

# ``TURN_GAIN``: yaw rate per error of the heading, 1/s.
# ``TURN_RATE_RAD_S``: largest wanted yaw rate, rad/s.
TURN_GAIN, TURN_RATE_RAD_S = 3.0, 2.0
#: If the heading error exceeds this angle, rad, the robot turns before it drives.
_TURN_FIRST_RAD = 1.0


@register_jitable
def wrapped(angle: float) -> float:
    """Returns the equivalent angle in the range from -pi to pi, rad."""
    return (angle + math.pi) % math.tau - math.pi


@register_jitable
def turn_rate(error: float) -> float:
    """Computes the yaw rate that corrects an error of the heading.

    Args:
        error: Wanted heading minus present heading, rad.

    Returns:
        Yaw rate, rad/s, between -``TURN_RATE_RAD_S`` and ``TURN_RATE_RAD_S``.
    """
    return min(max(TURN_GAIN * error, -TURN_RATE_RAD_S), TURN_RATE_RAD_S)


@register_jitable
def slowed_by(error: float, speed: float) -> float:
    """Reduces a forward speed while the robot turns.

    Args:
        error: Error of the heading, rad.
        speed: Wanted speed, m/s. A negative speed does not change.

    Returns:
        Speed, m/s. If the robot has to turn before it drives, the speed is 0.
    """
    if speed > 0.0:
        speed *= math.cos(error) if abs(error) < _TURN_FIRST_RAD else 0.0
    return speed


@register_jitable
def turn_towards(speed: float, heading: float, theta: float) -> tuple[float, float]:
    """Computes the motion that turns a robot to a heading while the robot drives.

    Args:
        speed: Wanted speed, m/s. The heading error reduces a forward speed. If the
            error is large, the speed is 0.
        heading: Wanted heading in the world frame W, rad.
        theta: Heading of the robot in W, rad.

    Returns:
        Forward speed, m/s, and yaw rate, rad/s.
    """
    error = wrapped(heading - theta)
    return slowed_by(error, speed), turn_rate(error)
