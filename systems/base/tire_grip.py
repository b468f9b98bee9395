"""Grip of the two driven wheels: friction forces up to a limit."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable

from systems.base.robot import RobotParameters

GRAVITY_M_S2 = 9.81
#: Time constant of the decay of the remaining slip when a wheel grips again, s. With
#: this time constant, the longest step of the integrator (25 ms) is stable.
_REGRIP_S = 0.016
#: Number of iterations of the search for the limited forces. With the printed
#: dimensions (Han 2019), each iteration multiplies the error by 0.4. If the body is no
#: wider than the distance between its wheels, the factor is two thirds.
_SWEEPS = 60


class GripNumbers(NamedTuple):
    """Constants of the grip. The mass of the robot cancels."""

    traction_m_s2: float
    """Largest force of one wheel, divided by the mass of the robot, m/s^2."""
    gyration_m2: float
    """Moment of inertia about the vertical axis, divided by the mass, m^2."""

    @classmethod
    def of(cls, robot: RobotParameters, friction: float) -> GripNumbers:
        """Computes the constants for a uniform rectangle on two equally loaded wheels.

        With the coefficient of friction mu, ``traction_m_s2`` is mu * gravity / 2.
        ``gyration_m2`` is (length^2 + width^2) / 12.
        """
        return cls(
            friction * GRAVITY_M_S2 / 2.0,
            (robot.length_m**2 + robot.width_m**2) / 12.0,
        )


@register_jitable
def grip_accelerations(
    motion: Any,
    rims: Any,
    rim_accelerations: Any,
    wheel_separation_m: float,
    grip: GripNumbers,
) -> tuple[Any, Any, Any]:
    """Computes the acceleration that the tire forces give to the body.

    All forces are divided by the mass of the robot. The function first computes the
    forces that prevent all slip. If the force of each wheel is within its limit
    ``traction_m_s2``, these forces are the result.

    Otherwise some slip is inevitable. Among all forces within the limit, the function
    chooses those that bring the motion nearest to motion without slip (Gauss' principle
    of least constraint). Projected gradient descent finds these forces. The force on a
    sliding wheel then opposes the slip with the full limit, and has no component
    across the slip.

    Args:
        motion: Forward and leftward speed of the middle of the axle, m/s, and yaw rate,
            rad/s; floats or AutoDiffXd.
        rims: Left and right rim speed, m/s.
        rim_accelerations: Left and right rim acceleration, m/s^2.
        wheel_separation_m: Distance between the wheels, m.
        grip: Force limit and moment of inertia, each divided by the mass.

    Returns:
        Rates of change of ``motion``, m/s^2 and rad/s^2.
    """
    forward, sideways, yaw = motion
    traction_m_s2, gyration_m2 = grip
    half = wheel_separation_m / 2.0
    # Accelerations of the contact points with which slip stays zero or decays to zero.
    left_slip = rims[0] - (forward - yaw * half)
    right_slip = rims[1] - (forward + yaw * half)
    left_wanted = rim_accelerations[0] + left_slip / _REGRIP_S
    right_wanted = rim_accelerations[1] + right_slip / _REGRIP_S
    # Forces that prevent slip, divided by the mass. Both wheels share the push and the
    # lateral force equally.
    lever = half * half / gyration_m2
    push = (left_wanted + right_wanted) / 2.0 - yaw * sideways
    twist = (right_wanted - left_wanted) / (2.0 * lever)
    side = -sideways / _REGRIP_S + yaw * forward
    left_x, right_x = (push - twist) / 2.0, (push + twist) / 2.0
    left_y, right_y = side / 2.0, side / 2.0
    largest = max(left_x * left_x, right_x * right_x) + left_y * left_y
    if largest > traction_m_s2 * traction_m_s2:
        # Projected gradient descent on the missing acceleration.
        gain = 0.5 * min(1.0, 1.0 / lever)
        for _ in range(_SWEEPS):
            along = left_x + right_x - push
            around = lever * (right_x - left_x - twist)
            aside = gain * (left_y + right_y - side)
            left_x, left_y = _limited(
                left_x - gain * (along - around), left_y - aside, traction_m_s2
            )
            right_x, right_y = _limited(
                right_x - gain * (along + around), right_y - aside, traction_m_s2
            )
    return (
        left_x + right_x + yaw * sideways,
        left_y + right_y - yaw * forward,
        (right_x - left_x) * half / gyration_m2,
    )


@register_jitable
def _limited(x: Any, y: Any, limit: float) -> tuple[Any, Any]:
    """Scales a force down to the limit, in the same direction."""
    square = x * x + y * y
    if square > limit * limit:
        scale = limit / np.sqrt(square)
        return x * scale, y * scale
    return x, y
