"""Computes the motion of a robot that carries a loudspeaker along its waypoints.

The carrier is a differential-drive robot. It has the same equations of motion as the
follower robot (``plant_derivatives``). The controller of the carrier knows the exact
pose. No other body acts on the carrier, so its motion is a function of time alone. The
module integrates the motion once, one control period (tick) after the other, up to the
latest time that any caller needs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from systems.base.diff_drive_plant import PlantNumbers, body_twist, plant_derivatives
from systems.base.parameters import PlantParameters
from systems.base.robot import RobotParameters
from systems.base.source_drive import (
    TOP_SPEED_M_S,
    WHEEL_ACCELERATION_M_S2,
    WHEEL_RADIUS_M,
    WHEEL_SEPARATION_M,
    value_weights,
)
from systems.framework.compiling import njit
from systems.framework.signals import TICK_S
from systems.world.paths import WaypointPath

register_jitable(value_weights)

#: Wheels of the carrier.
_ROBOT = RobotParameters(
    wheel_radius_m=WHEEL_RADIUS_M,
    wheel_separation_m=WHEEL_SEPARATION_M,
    top_speed_m_s=TOP_SPEED_M_S,
)
#: Motors of the carrier. They have the default motor lag of the follower robot.
_PLANT = PlantParameters()
_NUMBERS = tuple(PlantNumbers.of(_ROBOT, _PLANT))

#: Limit of the difference between the commanded and the present speed of a wheel,
#: rad/s. The acceleration of a wheel is this difference divided by the motor lag.
_MOST = WHEEL_ACCELERATION_M_S2 / WHEEL_RADIUS_M * _PLANT.motor_lag_s

#: Mean time from a command to its effect, s. It is the motor lag plus half a control
#: period, because each command is held for one period. The feed-forward uses the plan
#: this far ahead.
LEAD_S = _PLANT.motor_lag_s + 0.5 * TICK_S

# Feedback gains of three errors:
# - _AHEAD, 1/s: longitudinal error. It decays in half a second (ten motor lags).
# - _ASIDE, 1/m^2: lateral error. It decays over 0.3 m of the path at 0.3 m/s.
# - _TURN, 1/s: heading error.
_AHEAD, _ASIDE, _TURN = 2.0, 50.0, 5.0

# Number of integration steps per control period.
_STEPS_A_TICK = 5


def drive_along(
    plan: WaypointPath, ticks: tuple[int, int], knot: Sequence[float]
) -> NDArray[np.float64]:
    """Continues the motion of a carrier from one control period (tick) to a later one.

    Args:
        plan: Path that the carrier follows.
        ticks: Numbers of the first and of the last tick of the interval.
        knot: (8,) state at the first tick: pose in the world frame W (m, m, rad),
            velocity in W (m/s, m/s, rad/s), and left and right wheel speed (rad/s).

    Returns:
        (n, 8) states, one row per tick. The rows begin one tick after the first tick
        and end at the last tick. The columns are those of ``knot``.
    """
    times = np.arange(*ticks) * TICK_S
    states = drive(
        np.array([*knot[:3], 0.0, 0.0, *knot[6:]]),
        plan.poses(times),
        plan.twists(times + LEAD_S),
    )[1:]
    theta, wheels = states[:, 2], states[:, 5:]
    v, omega = body_twist(wheels.T, _ROBOT)
    velocities = np.stack([v * np.cos(theta), v * np.sin(theta), omega], axis=1)
    return np.hstack([states[:, :3], velocities, wheels])


@njit(cache=True)
def drive(
    state: NDArray[np.float64],
    poses: NDArray[np.float64],
    twists: NDArray[np.float64],
) -> NDArray[np.float64]:  # pragma: no cover  (compiled)
    """Simulates a carrier that follows planned poses by feed-forward and feedback.

    In each control period (tick), the function does these steps:

    1. Compute the longitudinal, lateral, and heading errors.
    2. Add the feedback of these errors to the planned speed and yaw rate.
    3. Convert the sum to wheel commands and limit the acceleration of each wheel.
    4. Integrate the equations of motion by the classical Runge-Kutta method of fourth
       order.

    Args:
        state: (7,) state of the robot at the first tick, see ``plant_derivatives``.
        poses: (n, 3) planned pose at each tick in the world frame W, m and rad.
        twists: (n, 2) planned speed, m/s, and yaw rate, rad/s. Row k is the plan for
            the time ``LEAD_S`` after tick k, when the command of tick k takes effect.

    Returns:
        (n + 1, 7) states, at the n ticks and one tick later.

    Reference: the feedback is that of Kanayama, Kimura, Miyazaki and Noguchi, "A stable
    tracking control method for an autonomous mobile robot", ICRA 1990. In contrast to
    the paper, the gain of the heading error does not vanish at rest.
    """
    states = np.empty((len(poses) + 1, 7))
    command = np.empty(2)
    for k in range(7):  # a slice would also compile the error message for its shape
        states[0, k] = state[k]
    step = TICK_S / _STEPS_A_TICK
    for k in range(len(poses)):
        now = states[k]
        dx, dy = poses[k, 0] - now[0], poses[k, 1] - now[1]
        c, s = math.cos(now[2]), math.sin(now[2])
        turn = poses[k, 2] - now[2]
        speed = twists[k, 0] * math.cos(turn) + _AHEAD * (c * dx + s * dy)
        aside = twists[k, 0] * (c * dy - s * dx)
        yaw_rate = twists[k, 1] + _ASIDE * aside + _TURN * math.sin(turn)
        for wheel, side in enumerate((-0.5, 0.5)):
            wanted = (speed + side * yaw_rate * WHEEL_SEPARATION_M) / WHEEL_RADIUS_M
            ahead = wanted - now[5 + wheel]
            command[wheel] = now[5 + wheel] + min(max(ahead, -_MOST), _MOST)
        after = now
        for _ in range(_STEPS_A_TICK):
            k1 = plant_derivatives(after, command, *_NUMBERS)
            k2 = plant_derivatives(after + 0.5 * step * k1, command, *_NUMBERS)
            k3 = plant_derivatives(after + 0.5 * step * k2, command, *_NUMBERS)
            k4 = plant_derivatives(after + step * k3, command, *_NUMBERS)
            after = after + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        for i in range(7):
            states[k + 1, i] = after[i]
    return states


@njit(cache=True)
def poses_between(
    knots: NDArray[np.float64], ticks: NDArray[np.float64]
) -> NDArray[np.float64]:  # pragma: no cover  (compiled)
    """Interpolates poses between knots by cubic Hermite polynomials.

    Args:
        knots: (m, 8) states of the robot, one control period (tick) apart. The columns
            are those of ``knot`` in ``drive_along``.
        ticks: (n,) times since the first knot, in ticks. Times after the last knot give
            the pose of the last knot.

    Returns:
        (n, 3) poses in the world frame W, m and rad.
    """
    poses = np.empty((ticks.size, 3))
    for i in range(ticks.size):
        k = min(int(ticks[i]), len(knots) - 2)
        p, q, r = value_weights(min(ticks[i] - k, 1.0))
        a, b = knots[k], knots[k + 1]
        for j in range(3):
            poses[i, j] = a[j] + p * (b[j] - a[j]) + q * a[3 + j] + r * b[3 + j]
    return poses
