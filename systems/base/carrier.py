"""The robot that carries a loudspeaker, driven along its waypoints.

It is a differential drive of the plant's kind (``plant_derivatives``), whose
controller knows its pose. Nothing acts back on it, so that its motion is a function
of time: it is integrated once, tick by tick and as far as asked.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np
from numba import njit
from numba.extending import register_jitable
from numpy.typing import ArrayLike, NDArray
from pydantic import model_validator

from systems.base.diff_drive_plant import (
    PlantNumbers,
    PlantParameters,
    body_twist,
    plant_derivatives,
)
from systems.base.robot import RobotParameters
from systems.framework.input_error import InputError
from systems.framework.parameters import (
    Acceleration,
    Length,
    Mass,
    NonNegativeSpeed,
    Parameters,
    Positive,
    Speed,
    Time,
    Waypoints,
)
from systems.framework.signals import TICK_S
from systems.world.paths import ACCELERATION_M_S2, AtEnd, WaypointPath

__all__ = ["CarrierParameters", "DrivenPath", "drive"]

#: How the wheels' speeds follow their commands: as the slave robot's.
_PLANT = PlantParameters()

#: Commands are meant for when they have taken effect: half a tick is held, and the
#: motors lag.
LEAD_S = _PLANT.motor_lag_s + 0.5 * TICK_S

# Feedback: of the way ahead, 1/s, of the way aside, 1/m^2, and of the heading, 1/s.
# The first decays within half a second, ten lags; with the other two, lateral errors
# decay over 0.3 m of the way at 0.3 m/s.
_AHEAD, _ASIDE, _TURN = 2.0, 50.0, 5.0

#: After the end of the planned motion the robot is held: by then the feedback moves
#: it by less than 1 nm/s.
_SETTLING_S = 10.0

#: The wheels' acceleration is this many times the path's at least: as much as a
#: command that is held for half a lag needs, and some to correct.
_HEADROOM = 1.5

#: See ``CarrierParameters.top_yaw_rate``.
_TURN_IN_RAD = 0.08

_CHUNK_TICKS = 400
_STEPS_A_TICK = 5


class CarrierParameters(Parameters):
    """Path and drive of a robot that carries a loudspeaker (Han 2019, table 5)."""

    waypoints_m: Waypoints = ((2.0, 0.0),)
    """Waypoints in W, m; one point is a source at rest."""
    speed_m_s: NonNegativeSpeed = 0.3
    """Speed along the path, m/s (Han 2019, 5.3)."""
    acceleration_m_s2: Acceleration = ACCELERATION_M_S2
    """Of the speed along the path, m/s^2."""
    corner_radius_m: Length = 0.3
    """Largest radius of the rounded corners, m."""
    start_time_s: Time = 0.0
    """The source rests at its first waypoint until then, s."""
    at_end: AtEnd = "stop"
    """At the last waypoint: rest, or go back and forth."""
    wheel_radius_m: Length = 0.06
    """Radius of the driven wheels, m."""
    wheel_separation_m: Length = 0.29
    """Distance between the driven wheels, m."""
    mass_kg: Mass = 5.3
    """Mass, kg."""
    wheel_force_n: Positive = 5.3
    """Largest force of each motor at its wheel's rim, N: with the mass it limits the
    wheels' acceleration, to 2 m/s^2 by default."""
    top_speed_m_s: Speed = 1.0
    """Limit of each wheel's rim speed, m/s."""

    @model_validator(mode="after")
    def _check_path(self) -> CarrierParameters:
        rim = self.speed_m_s + 0.5 * self.wheel_separation_m * self.top_yaw_rate
        if rim > self.top_speed_m_s:
            raise InputError(
                "speed_m_s",
                f"at {self.speed_m_s:g} m/s corners need wheels that reach "
                f"{rim:.3g} m/s, not {self.top_speed_m_s:g} m/s; lower it, or raise "
                "top_speed_m_s",
            )
        if self.acceleration_m_s2 * _HEADROOM > self.wheel_acceleration_m_s2:
            raise InputError(
                "acceleration_m_s2",
                f"{self.acceleration_m_s2:g} m/s^2 is too much for "
                f"wheels that reach {self.wheel_acceleration_m_s2:g} m/s^2, which must "
                f"be {_HEADROOM:g} times as much; lower it, or raise wheel_force_n",
            )
        self.path()
        return self

    @property
    def wheel_acceleration_m_s2(self) -> float:
        """Limit of the acceleration of each wheel's rim, m/s^2.

        Of both wheels ahead, 2 F/m; one ahead and one back turn the body, whose
        inertia about its centre is about that of half its mass at each wheel.
        """
        return 2.0 * self.wheel_force_n / self.mass_kg

    @property
    def top_yaw_rate(self) -> float:
        """In corners, rad/s: the wheels reach it while the robot turns by 0.08 rad."""
        yaw_acceleration = 2.0 * self.wheel_acceleration_m_s2 / self.wheel_separation_m
        return math.sqrt(2.0 * _TURN_IN_RAD * yaw_acceleration)

    @property
    def rest_heading(self) -> float:
        """Heading where there is one waypoint, rad."""
        return 0.0

    def path(self) -> DrivenPath:
        """The motion as a function of time."""
        return _driven_path(self)

    def plan(self) -> WaypointPath:
        """The motion that is asked for, from time 0 on."""
        return WaypointPath(
            self.waypoints_m,
            speed=self.speed_m_s,
            acceleration=self.acceleration_m_s2,
            corner_radius=self.corner_radius_m,
            at_end=self.at_end,
            heading=self.rest_heading,
            top_yaw_rate=self.top_yaw_rate,
        )


@lru_cache(maxsize=16)
def _driven_path(carrier: CarrierParameters) -> DrivenPath:
    # A run asks for the same motion many times, and the runs of a sweep in turn.
    return DrivenPath(carrier)


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


class DrivenPath:
    """Pose and velocity of a robot that drives through waypoints.

    Commands go out every 25 ms, whatever the tick of those that follow it, from the
    start on; between them the pose follows the cubic Hermite polynomial, within 1 um
    and 10 urad of the plant. The robot is
    within 2 mm of its plan in the library's scenarios, and at 0.7 m/s within 4 cm
    beside the arcs of corners; it rests within 5 mm of the last waypoint.

    Args:
        carrier: ``CarrierParameters``.
    """

    def __init__(self, carrier: CarrierParameters) -> None:
        self._start = carrier.start_time_s
        self._plan = plan = carrier.plan()
        self._robot = robot = RobotParameters(
            wheel_radius_m=carrier.wheel_radius_m,
            wheel_separation_m=carrier.wheel_separation_m,
            mass_kg=carrier.mass_kg,
            top_speed_m_s=carrier.top_speed_m_s,
        )
        self._drive_numbers = (
            carrier.wheel_acceleration_m_s2 / carrier.wheel_radius_m,
            carrier.wheel_radius_m,
            carrier.wheel_separation_m,
            _PLANT.motor_lag_s,
            *PlantNumbers.of(robot, _PLANT),
        )
        self.moves = plan.moves
        """Whether it ever leaves its first waypoint."""
        self.length = plan.length
        """Length of the planned path, m."""
        self._rest = plan.pose(0.0)
        self._end = math.inf
        if carrier.at_end == "stop":
            self._end = math.ceil((plan.duration + _SETTLING_S) / TICK_S)
        # Pose, velocity and wheel speeds at the ticks so far; rows of floats are
        # read one by one faster than those of an array.
        self._knots = [[*self._rest, 0.0, 0.0, 0.0, 0.0, 0.0]]
        self._table = np.array(self._knots)

    def _drive_on(self, tick: int) -> None:
        """Has the knots up to the one after a tick, or to the end."""
        knots = self._knots
        first = len(knots) - 1
        if first == self._end:
            return
        last = min(first + max(tick + 1 - first, _CHUNK_TICKS), self._end)
        ticks = np.arange(first, last) * TICK_S
        poses = self._plan.poses(ticks)
        twists = self._plan.twists(ticks + LEAD_S)
        state = np.array([*knots[-1][:3], 0.0, 0.0, *knots[-1][6:]])
        states = drive(state, poses, twists, *self._drive_numbers)[1:]
        if last == self._end:
            states[-1, 5:] = 0.0
        theta, wheels = states[:, 2], states[:, 5:]
        v, omega = body_twist(wheels.T, self._robot)
        velocities = np.stack([v * np.cos(theta), v * np.sin(theta), omega], axis=1)
        rows = np.hstack([states[:, :3], velocities, wheels])
        self._knots = knots + rows.tolist()
        self._table = np.vstack([self._table, rows])

    def _since(self, ticks: float) -> tuple[float, list[float], list[float]]:
        """Part of the tick that has passed, and the knots at its ends."""
        if ticks >= len(self._knots) - 1:
            self._drive_on(int(min(ticks, self._end)))
        k = min(int(ticks), len(self._knots) - 2)
        return min(ticks - k, 1.0), self._knots[k], self._knots[k + 1]

    def pose(self, time: float) -> tuple[float, float, float]:
        """(x, y, theta) in W at a time in s; m and rad."""
        if not self.moves or time <= self._start:
            return self._rest
        s, a, b = self._since((time - self._start) / TICK_S)
        p, q, r = _value_weights(s)
        return (
            a[0] + p * (b[0] - a[0]) + q * a[3] + r * b[3],
            a[1] + p * (b[1] - a[1]) + q * a[4] + r * b[4],
            a[2] + p * (b[2] - a[2]) + q * a[5] + r * b[5],
        )

    def poses(self, times: ArrayLike) -> NDArray[np.float64]:
        """(n, 3) poses at many times at once, as ``pose`` gives them one by one."""
        times = np.asarray(times, dtype=float)
        if not self.moves or not len(times):
            return np.full((len(times), 3), self._rest)
        ticks = np.maximum((times - self._start) / TICK_S, 0.0)
        self._since(ticks.max())
        return _poses_between(self._table, ticks)

    def velocity(self, time: float) -> tuple[float, float, float]:
        """(vx, vy, omega) in W at a time in s; m/s and rad/s."""
        if not self.moves or time <= self._start:
            return (0.0, 0.0, 0.0)
        s, a, b = self._since((time - self._start) / TICK_S)
        p = 6.0 * s * (1.0 - s) / TICK_S
        q, r = (1.0 - s) * (1.0 - 3.0 * s), s * (3.0 * s - 2.0)
        return (
            p * (b[0] - a[0]) + q * a[3] + r * b[3],
            p * (b[1] - a[1]) + q * a[4] + r * b[4],
            p * (b[2] - a[2]) + q * a[5] + r * b[5],
        )


@register_jitable
def _value_weights(s: Any) -> tuple[Any, Any, Any]:
    """Of the cubic Hermite polynomial at s in [0, 1]: of b - a and of the slopes."""
    rest = TICK_S * s * (1.0 - s)
    return s * s * (3.0 - 2.0 * s), rest * (1.0 - s), -rest * s


@njit(cache=True)
def _poses_between(
    knots: NDArray[np.float64], ticks: NDArray[np.float64]
) -> NDArray[np.float64]:  # pragma: no cover  (compiled)
    """(n, 3) poses at times in ticks since the first knot; after the last one, its."""
    poses = np.empty((ticks.size, 3))
    for i in range(ticks.size):
        k = min(int(ticks[i]), len(knots) - 2)
        p, q, r = _value_weights(min(ticks[i] - k, 1.0))
        a, b = knots[k], knots[k + 1]
        for j in range(3):
            poses[i, j] = a[j] + p * (b[j] - a[j]) + q * a[3 + j] + r * b[3 + j]
    return poses
