"""Forward speed and yaw rate that turn a robot to a wanted heading."""

from __future__ import annotations

import math

from numba.extending import register_jitable

# ``TURN_GAIN``: yaw rate per error of the heading, 1/s.
# ``TURN_RATE_RAD_S``: largest wanted yaw rate, rad/s.
TURN_GAIN, TURN_RATE_RAD_S = 3.0, 2.0
#: If the heading error exceeds this angle, rad, the robot turns before it drives.
TURN_FIRST_RAD = 1.0


@register_jitable
def wrapped(angle: float) -> float:
    """Returns the equivalent angle in the range from -pi to pi, rad."""
    return (angle + math.pi) % math.tau - math.pi


@register_jitable
def turn_rate(error: float) -> float:
    """Computes the yaw rate that corrects a heading error.

    ``error`` is the wanted heading minus the present heading, rad. The yaw rate, rad/s,
    is between -``TURN_RATE_RAD_S`` and ``TURN_RATE_RAD_S``.
    """
    return min(max(TURN_GAIN * error, -TURN_RATE_RAD_S), TURN_RATE_RAD_S)


@register_jitable
def slowed_by(error: float, speed: float) -> float:
    """Reduces the forward speed of a robot that has to turn.

    Args:
        error: Wanted heading minus present heading, rad.
        speed: Wanted speed, m/s. A negative speed does not change.

    Returns:
        Speed, m/s; 0 if the error is so large that the robot first has to turn.
    """
    if speed > 0.0:
        speed *= math.cos(error) if abs(error) < TURN_FIRST_RAD else 0.0
    return speed


@register_jitable
def turn_toward(speed: float, heading: float, theta: float) -> tuple[float, float]:
    """Computes the speed and yaw rate that turn a moving robot to a heading.

    Args:
        speed: Wanted speed, m/s.
        heading: Wanted heading in the world frame W, rad.
        theta: Present heading in W, rad.

    Returns:
        Speed, m/s, as from ``slowed_by``, and yaw rate, rad/s.
    """
    error = wrapped(heading - theta)
    return slowed_by(error, speed), turn_rate(error)
