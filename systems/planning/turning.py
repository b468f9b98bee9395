"""Forward speed and yaw rate that turn a robot to a wanted heading."""

from __future__ import annotations

import math

from numba.extending import register_jitable

#: Yaw rate per error of the heading, 1/s, and largest wanted yaw rate, rad/s.
TURN_GAIN, TURN_RATE_RAD_S = 3.0, 2.0
#: If the heading error is larger than this angle, rad, the robot turns before it
#: drives.
_TURN_FIRST_RAD = 1.0


@register_jitable
def wrapped(angle: float) -> float:
    """Returns the same angle in the range from -pi to pi, rad."""
    return (angle + math.pi) % math.tau - math.pi


@register_jitable
def turn_rate(error: float) -> float:
    """Computes the yaw rate that corrects an error of the heading.

    Args:
        error: Wanted heading minus heading, rad.

    Returns:
        Yaw rate, rad/s, at most ``TURN_RATE_RAD_S``.
    """
    return min(max(TURN_GAIN * error, -TURN_RATE_RAD_S), TURN_RATE_RAD_S)


@register_jitable
def slowed_by(error: float, speed: float) -> float:
    """Reduces a forward speed while the robot turns.

    Args:
        error: Error of the heading, rad.
        speed: Wanted speed, m/s. A negative speed is not changed.

    Returns:
        Speed, m/s; 0 if the robot has to turn before it drives.
    """
    if speed > 0.0:
        speed *= math.cos(error) if abs(error) < _TURN_FIRST_RAD else 0.0
    return speed


@register_jitable
def turn_towards(speed: float, heading: float, theta: float) -> tuple[float, float]:
    """Computes the motion that turns a robot to a heading while it drives.

    Args:
        speed: Wanted speed, m/s. If the heading error is large, forward speeds are
            reduced to 0.
        heading: Wanted heading in W, rad.
        theta: Heading of the robot in W, rad.

    Returns:
        Forward speed, m/s, and yaw rate, rad/s.
    """
    error = wrapped(heading - theta)
    return slowed_by(error, speed), turn_rate(error)
