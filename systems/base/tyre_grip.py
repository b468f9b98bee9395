"""Grip of the two driven wheels: friction that holds them, up to a limit."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable

from systems.base.robot import RobotParameters

GRAVITY_M_S2 = 9.81
#: Slip that is left when a wheel grips again decays in this time, s: a third-order
#: step of 25 ms takes 98 % of it, and any scheme of the integrator is stable.
_REGRIP_S = 0.016
#: Of the search for forces. What is wanting falls to 0.4 in each with the printed
#: dimensions, to two thirds with a body no wider than its wheels are apart.
_SWEEPS = 60


class GripNumbers(NamedTuple):
    """What the grip hangs on; the robot's mass cancels."""

    traction_m_s2: float
    """Largest force of one wheel over the mass of the robot, m/s^2."""
    gyration_m2: float
    """Moment of inertia about the vertical axis over the mass, m^2."""

    @classmethod
    def of(cls, robot: RobotParameters, friction: float) -> GripNumbers:
        """A uniform rectangle whose weight the two driven wheels share.

        Args:
            robot: Length and width of the rectangle.
            friction: Coefficient between tyres and floor.

        Returns:
            Half of friction times gravity, m/s^2, and (length^2 + width^2) / 12, m^2.
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
    """How the body's velocity changes by the forces of its tyres.

    Where the floor can give them, the forces are those with which no wheel slips.
    Where it cannot, they are those of at most ``traction_m_s2``, in any direction,
    that come nearest to it (Gauss' principle of least constraint): a sliding wheel
    pushes with the limit along its slip, and has none left for the side.

    Args:
        motion: Forward and leftward speed of the axle's middle, m/s, and yaw rate,
            rad/s; floats or AutoDiffXd.
        rims: Left and right rim speed, m/s.
        rim_accelerations: Their rates of change, m/s^2.
        wheel_separation_m: Distance between the wheels, m.
        grip: ``GripNumbers``.

    Returns:
        Rates of change of ``motion``, m/s^2 and rad/s^2.
    """
    forward, sideways, yaw = motion
    traction_m_s2, gyration_m2 = grip
    half = wheel_separation_m / 2.0
    # What each contact should do so that its slip is or becomes nothing.
    left_slip = rims[0] - (forward - yaw * half)
    right_slip = rims[1] - (forward + yaw * half)
    left_wanted = rim_accelerations[0] + left_slip / _REGRIP_S
    right_wanted = rim_accelerations[1] + right_slip / _REGRIP_S
    # Forces over the mass with which no wheel slips, halved between the wheels.
    lever = half * half / gyration_m2
    push = (left_wanted + right_wanted) / 2.0 - yaw * sideways
    twist = (right_wanted - left_wanted) / (2.0 * lever)
    side = -sideways / _REGRIP_S + yaw * forward
    left_x, right_x = (push - twist) / 2.0, (push + twist) / 2.0
    left_y, right_y = side / 2.0, side / 2.0
    largest = max(left_x * left_x, right_x * right_x) + left_y * left_y
    if largest > traction_m_s2 * traction_m_s2:
        # Projected gradient descent on what is wanting.
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
    """A force of at most this size in the same direction."""
    square = x * x + y * y
    if square > limit * limit:
        scale = limit / np.sqrt(square)
        return x * scale, y * scale
    return x, y
