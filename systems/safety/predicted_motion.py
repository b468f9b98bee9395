"""Prediction of the motion of a robot that obeys a command and brakes to rest."""

from __future__ import annotations

from typing import Any, NamedTuple

from numba.extending import register_jitable

from systems.base.lagged_motion import LaggedMotion, advance_pose
from systems.framework.compiling import njit
from systems.safety.outline import Outline


class BrakingNumbers(NamedTuple):
    """Model of the robot's motion and braking, and distances that the robot keeps."""

    wheel_radius_m: float
    wheel_separation_m: float
    motor_lag_s: float
    """Time constant of the wheels' speeds, s."""
    braking_m_s2: float
    """Deceleration of the commanded speed of the faster rim, m/s^2."""
    tick_s: float
    parts: int
    """Number of parts of a control period. At the end of each part, the guard compares
    the position of the robot with the cells.
    """
    part: LaggedMotion
    """Motion of the wheels in one part."""
    top_wheel_speed: float
    """Top speed of a wheel, rad/s."""
    outline: Outline
    keep_m: float
    """Distance that the outline has to keep from non-free space, m."""
    least_m: float
    """Distance below which the outline may not come nearer to a cell, m."""
    obstacle_speed_m_s: float
    """Largest speed of obstacles in view, m/s. With 0, all obstacles are at rest."""


@register_jitable
def rolled_speeds(speeds: Any, commanded: Any, kept: float) -> tuple[float, float]:
    """Computes the wheel speeds at the end of a time with a constant command.

    Args:
        speeds: Speeds of the left and right wheel at the start, rad/s.
        commanded: Commanded speeds of the left and right wheel, rad/s.
        kept: Share of the difference between actual and commanded speed that remains at
            the end, 0 to 1.

    Returns:
        Speeds of the left and right wheel at the end, rad/s.
    """
    left = commanded[0] + (speeds[0] - commanded[0]) * kept
    right = commanded[1] + (speeds[1] - commanded[1]) * kept
    return left, right


@njit(cache=True)
def roll_on(
    pose: Any, speeds: Any, commanded: Any, numbers: BrakingNumbers
) -> tuple[Any, Any]:  # pragma: no cover  (compiled)
    """Computes the pose and the wheel speeds after one part of a control period.

    The wheels roll without slip.

    Args:
        pose: Pose (x, y, theta) at the start, m and rad.
        speeds: Speeds of the left and right wheel at the start, rad/s.
        commanded: Constant commanded speeds of the left and right wheel, rad/s.
        numbers: Model of the robot.

    Returns:
        Pose (x, y, theta) at the end, m and rad, and speeds of the left and right wheel
        at the end, rad/s.
    """
    part = numbers.part
    duration, lagged = part.duration_s, part.lagged_s
    steady_left, steady_right = commanded[0] * duration, commanded[1] * duration
    left = steady_left + (speeds[0] - commanded[0]) * lagged
    right = steady_right + (speeds[1] - commanded[1]) * lagged
    forward = 0.5 * numbers.wheel_radius_m
    turning = numbers.wheel_radius_m / numbers.wheel_separation_m
    moved = advance_pose(
        pose,
        (forward * (left + right), turning * (right - left)),
        (
            forward * (steady_left + steady_right),
            turning * (steady_right - steady_left),
        ),
        part,
    )
    return moved, rolled_speeds(speeds, commanded, part.kept)


@njit(cache=True)
def braked(
    commanded: Any, numbers: BrakingNumbers
) -> tuple[float, float]:  # pragma: no cover  (compiled)
    """Computes the next command of a robot that brakes without leaving its curve.

    Args:
        commanded: Present commanded speeds of the left and right wheel, rad/s.
        numbers: Model of the robot, for the deceleration.

    Returns:
        Next commanded speeds of the left and right wheel, rad/s.
    """
    fastest = max(abs(commanded[0]), abs(commanded[1])) * numbers.wheel_radius_m
    less = numbers.braking_m_s2 * numbers.tick_s
    if fastest <= less:
        return 0.0, 0.0
    share = 1.0 - less / fastest
    return commanded[0] * share, commanded[1] * share
