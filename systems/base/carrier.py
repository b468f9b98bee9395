"""The robot that carries a loudspeaker, driven along its waypoints.

It is a differential drive of the plant's kind (``plant_derivatives``), whose
controller knows its pose. Nothing acts back on it, so that its motion is a function
of time: it is integrated once, tick by tick and as far as asked.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from systems.base.diff_drive_plant import PlantNumbers, body_twist, plant_derivatives
from systems.base.hermite import value_weights
from systems.base.parameters import PlantParameters
from systems.base.robot import RobotParameters
from systems.framework.compiling import njit
from systems.framework.signals import TICK_S
from systems.world.paths import WaypointPath

register_jitable(value_weights)

#: How the wheels' speeds follow their commands: as the slave robot's.
_PLANT = PlantParameters()

#: Commands are meant for when they have taken effect: half a tick is held, and the
#: motors lag.
LEAD_S = _PLANT.motor_lag_s + 0.5 * TICK_S

# Feedback: of the way ahead, 1/s, of the way aside, 1/m^2, and of the heading, 1/s.
# The first decays within half a second, ten lags; with the other two, lateral errors
# decay over 0.3 m of the way at 0.3 m/s.
_AHEAD, _ASIDE, _TURN = 2.0, 50.0, 5.0

_STEPS_A_TICK = 5


def drive_along(
    robot: RobotParameters,
    wheel_acceleration_m_s2: float,
    plan: WaypointPath,
    ticks: tuple[int, int],
    knot: Sequence[float],
) -> NDArray[np.float64]:
    """Drives a carrier on, from one tick to another.

    Args:
        robot: Its wheels, mass and top speed.
        wheel_acceleration_m_s2: Limit of that of each wheel's rim, m/s^2.
        plan: Where it is to be.
        ticks: The first one, and the one before the last row.
        knot: (8,) at the first tick: pose, velocity in W and speeds of both wheels.

    Returns:
        (n, 8) the same at the ticks after the first.
    """
    times = np.arange(*ticks) * TICK_S
    states = drive(
        np.array([*knot[:3], 0.0, 0.0, *knot[6:]]),
        plan.poses(times),
        plan.twists(times + LEAD_S),
        wheel_acceleration_m_s2 / robot.wheel_radius_m,
        robot.wheel_radius_m,
        robot.wheel_separation_m,
        _PLANT.motor_lag_s,
        *PlantNumbers.of(robot, _PLANT),
    )[1:]
    theta, wheels = states[:, 2], states[:, 5:]
    v, omega = body_twist(wheels.T, robot)
    velocities = np.stack([v * np.cos(theta), v * np.sin(theta), omega], axis=1)
    return np.hstack([states[:, :3], velocities, wheels])


@njit(cache=True)
def drive(
    state: NDArray[np.float64],
    poses: NDArray[np.float64],
    twists: NDArray[np.float64],
    wheel_acceleration: float,
    radius: float,
    separation: float,
    lag: float,
    *numbers: float,
) -> NDArray[np.float64]:  # pragma: no cover  (compiled)
    """Follows a plan with feed-forward and feedback, tick by tick.

    Args:
        state: (7,) of the plant at the first tick, see ``plant_derivatives``.
        poses: (n, 3) where to be at each tick, m and rad.
        twists: (n, 2) speed, m/s, and yaw rate, rad/s, to have when commands have
            taken effect, ``LEAD_S`` later.
        wheel_acceleration: Limit, rad/s^2.
        radius: Of the wheels, m.
        separation: Of the wheels, m.
        lag: Of the motors, s.
        *numbers: ``PlantNumbers``.

    Returns:
        (n + 1, 7) states at the ticks.

    Reference: the feedback is that of Kanayama, Kimura, Miyazaki and Noguchi, "A stable
    tracking control method for an autonomous mobile robot", ICRA 1990, with a gain
    of the heading that does not vanish at rest.
    """
    states = np.empty((len(poses) + 1, 7))
    command = np.empty(2)
    for k in range(7):  # a slice compiles words about its shape
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
        # A wheel accelerates by what its command is ahead of it, over the lag.
        most = wheel_acceleration * lag
        for wheel, side in enumerate((-0.5, 0.5)):
            ahead = (speed + side * yaw_rate * separation) / radius - now[5 + wheel]
            command[wheel] = now[5 + wheel] + min(max(ahead, -most), most)
        after = now
        for _ in range(_STEPS_A_TICK):
            k1 = plant_derivatives(after, command, *numbers)
            k2 = plant_derivatives(after + 0.5 * step * k1, command, *numbers)
            k3 = plant_derivatives(after + 0.5 * step * k2, command, *numbers)
            k4 = plant_derivatives(after + step * k3, command, *numbers)
            after = after + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        for i in range(7):
            states[k + 1, i] = after[i]
    return states


@njit(cache=True)
def poses_between(
    knots: NDArray[np.float64], ticks: NDArray[np.float64]
) -> NDArray[np.float64]:  # pragma: no cover  (compiled)
    """Poses between knots.

    Args:
        knots: (m, 8) as of ``drive_along``, a tick apart.
        ticks: (n,) times since the first one, in ticks; after the last one, its.

    Returns:
        (n, 3) m and rad.
    """
    poses = np.empty((ticks.size, 3))
    for i in range(ticks.size):
        k = min(int(ticks[i]), len(knots) - 2)
        p, q, r = value_weights(min(ticks[i] - k, 1.0))
        a, b = knots[k], knots[k + 1]
        for j in range(3):
            poses[i, j] = a[j] + p * (b[j] - a[j]) + q * a[3 + j] + r * b[3 + j]
    return poses
