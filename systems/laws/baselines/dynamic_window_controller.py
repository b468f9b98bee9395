"""Baseline: the dynamic window approach of Fox, Burgard and Thrun, 1997."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from systems.base.parameters import PlantParameters
from systems.base.robot import RobotParameters, body_radius
from systems.framework.block import Step
from systems.framework.compiling import njit
from systems.framework.signals import TICK_S
from systems.laws.baselines.baseline_controller import (
    MapController,
    half_size,
    occupied_around,
)
from systems.laws.dynamic_window import DynamicWindowParameters
from systems.laws.parameters import AttractionParameters
from systems.planning.body_contact import in_body_axes, time_to_contact
from systems.planning.following import SPEED_LIMITS, FollowNumbers
from systems.planning.route_approach import (
    Approach,
    RouteNumbers,
    RouteState,
    approach_on_route,
    route_numbers,
    route_state,
)
from systems.planning.turning import slowed_by, wrapped
from systems.safety.parameters import GuardParameters

# ``_SPEEDS``: number of speeds in the grid over a window.
# ``_TURNS``: number of yaw rates in the grid over a window.
_SPEEDS, _TURNS = 9, 17
#: Half side of the square around the robot in which cells count, m. An obstacle that is
#: farther away on an arc counts as if it were at this distance.
_REACH_M = 2.5
# Limits of the window, and deceleration of a robot that brakes; the values of the robot
# Rhino in the paper.
# ``_ACCELERATION_M_S2``: acceleration, m/s^2.
# ``_TURN_ACCELERATION_RAD_S2``: yaw acceleration (60 deg/s^2), rad/s^2.
# ``_PERIOD_S``: time from one choice to the next, s.
_ACCELERATION_M_S2, _TURN_ACCELERATION_RAD_S2, _PERIOD_S = 0.5, math.pi / 3.0, 0.25


class WindowNumbers(NamedTuple):
    """Constants of the choice of a motion; see ``DynamicWindowParameters``."""

    gains: tuple[float, float, float]
    """Weights of heading, distance, and speed."""
    half_size: tuple[float, float]
    """Half of the body's length and width, m."""
    clearance_m: float
    """Distance that the body keeps from cells with echoes, m."""
    half_separation_m: float
    """Half of the distance between the wheels, m."""
    top_speed_m_s: float
    """Largest rim speed of each wheel, m/s."""
    lag_s: float
    """Time constant of the motors and delay of the command, s."""


class DynamicWindowNumbers(NamedTuple):
    """Constants of the step of ``DynamicWindowController``."""

    window: WindowNumbers
    route: RouteNumbers
    period_ticks: int


class DynamicWindowState(NamedTuple):
    """The state of ``DynamicWindowController``."""

    motion: NDArray[np.float64]
    """(2,) chosen speed, m/s, and yaw rate, rad/s."""
    route: RouteState


@njit(cache=True)
def _spread(
    low: float, high: float, k: int, count: int
) -> float:  # pragma: no cover  (compiled)
    """Returns number k of ``count`` values from low to high.

    The value nearest to 0 is 0, so that the grid contains a straight motion and a turn
    on the spot.
    """
    step = (high - low) / (count - 1)
    value = low + k * step
    return 0.0 if abs(value) < 0.5 * step else value


@njit(cache=True)
def _time_to_stop(
    motion: tuple[float, float], now: tuple[float, float], numbers: WindowNumbers
) -> float:  # pragma: no cover  (compiled)
    """Computes how long a motion must stay clear for the robot to brake in time, s.

    The paper requires v <= sqrt(2 dist a): the way v^2/(2a) of a braking robot must be
    shorter than the distance of the contact. The way here also contains that of one
    period, and that of the lag, in which the robot still has its present speed. The
    result is this way, divided by the speed. The yaw rate has the same condition.
    """
    needed = 0.0
    for k in range(2):
        speed = abs(motion[k])
        braking = _ACCELERATION_M_S2 if k == 0 else _TURN_ACCELERATION_RAD_S2
        if speed > 0.0:
            lag = numbers.lag_s * max(abs(now[k]) / speed, 1.0)
            needed = max(needed, _PERIOD_S + lag + 0.5 * speed / braking)
    return needed


@njit(cache=True)
def _braked(
    now: tuple[float, float],
) -> tuple[float, float]:  # pragma: no cover  (compiled)
    """Returns the slowest motion of the window on the present arc."""
    dv, dw = _ACCELERATION_M_S2 * _PERIOD_S, _TURN_ACCELERATION_RAD_S2 * _PERIOD_S
    kept = 0.0
    if abs(now[0]) > dv:
        kept = 1.0 - dv / abs(now[0])
    if abs(now[1]) > dw:
        kept = max(kept, 1.0 - dw / abs(now[1]))
    return kept * now[0], kept * now[1]


@njit(cache=True)
def choose_in_window(
    cells: tuple[Any, Any],
    pose: Any,
    now: tuple[float, float],
    speeds: tuple[float, float],
    goal: tuple[float, float, float],
    numbers: WindowNumbers,
) -> tuple[float, float]:  # pragma: no cover  (compiled)
    """Chooses speed and yaw rate by the dynamic window approach (Fox, eq. 13-15).

    The window contains all speeds and yaw rates that the robot can reach in one period.
    The function tries a grid of these motions. It rejects a motion if the robot could
    not brake to rest before it covers an occupied cell (``_time_to_stop``). From the
    remaining motions, it chooses the motion with the largest weighted sum of three
    terms, each from 0 to 1. The terms reward:

    - heading: a small angle between the heading after the motion and the goal
    - distance: a long way to the first contact, up to half a circle and to the goal
    - speed: a speed near the wanted speed

    As in the paper, the sum is smoothed: the sum of a motion is the mean over the
    motion and its neighbors in the grid. Rejected motions have the sum 0; motions above
    the top speed do not count.

    Args:
        cells: (n, 3) occupied cells of obstacles, and (k, 3) cells of the target: x and
            y in the world frame W, m, and the certainty, 0 to 1 (not used).
        pose: Pose (x, y, theta) of the axle in W, m and rad.
        now: Present speed, m/s, and present yaw rate, rad/s.
        speeds: Least speed, and wanted speed toward the goal, m/s. The wanted speed is
            also the largest speed.
        goal: Position (x, y) of the local goal in W, m, and distance that the robot has
            to drive to it, m.
        numbers: Weights and limits.

    Returns:
        Speed, m/s, and yaw rate, rad/s. If the function rejects all motions, the robot
        brakes on its present arc.
    """
    _, most, turn = SPEED_LIMITS
    top, half = numbers.top_speed_m_s, numbers.half_separation_m
    dv, dw = _ACCELERATION_M_S2 * _PERIOD_S, _TURN_ACCELERATION_RAD_S2 * _PERIOD_S
    least, wanted = speeds
    low = max(now[0] - dv, least)
    high = max(min(now[0] + dv, most, wanted), low)
    right, left = max(now[1] - dw, -turn), min(now[1] + dw, turn)
    body, kept = numbers.half_size, numbers.clearance_m
    wide = body[0] + kept, body[1] + kept
    around, near = in_body_axes(cells[0], pose, wide)
    near = np.concatenate((near, in_body_axes(cells[1], pose, body)[0]))
    values = np.full((_SPEEDS, _TURNS), np.nan)
    for i in range(_SPEEDS):
        v = _spread(low, high, i, _SPEEDS)
        for j in range(_TURNS):
            w = _spread(right, left, j, _TURNS)
            if abs(v) + half * abs(w) > top + 1e-9:
                continue
            # Points outside the clearance must stay outside it. Points already inside
            # the clearance, and those of the target, must stay outside the body.
            contact = time_to_contact(around, (v, w), wide)
            contact = min(contact, time_to_contact(near, (v, w), body))
            values[i, j] = 0.0
            if contact >= _time_to_stop((v, w), now, numbers):
                values[i, j] = _value((v, w), contact, pose, wanted, goal, numbers)
    found, best = _braked(now), 0.0
    for i in range(_SPEEDS):
        for j in range(_TURNS):
            if values[i, j] > 0.0:
                value = _smoothed(values, i, j)
                if value > best:
                    v, w = (
                        _spread(low, high, i, _SPEEDS),
                        _spread(right, left, j, _TURNS),
                    )
                    best, found = value, (v, w)
    return found


@njit(cache=True)
def _value(
    motion: tuple[float, float],
    contact: float,
    pose: Any,
    wanted: float,
    goal: tuple[float, float, float],
    numbers: WindowNumbers,
) -> float:  # pragma: no cover  (compiled)
    """Computes the weighted sum of heading, distance, and speed of a motion.

    ``contact`` is the time to the first contact, s. The distance along an arc is at
    most half a circle, because the robot would then come back. Obstacles beyond the
    goal do not count, and neither does the target itself. Only forward motions have a
    distance. The result is positive.
    """
    v, w = motion
    heading_gain, distance_gain, speed_gain = numbers.gains
    distance = 0.0
    if v > 0.0:
        way = v * contact if contact < np.inf else _REACH_M
        if w != 0.0:
            way = min(way, math.pi * v / abs(w))
        distance = min(way, goal[2], _REACH_M) / _REACH_M
    # Position after this period, and heading when the robot has stopped its turn.
    middle = pose[2] + 0.5 * w * _PERIOD_S
    x = pose[0] + v * _PERIOD_S * math.cos(middle)
    y = pose[1] + v * _PERIOD_S * math.sin(middle)
    theta = pose[2] + w * _PERIOD_S + 0.5 * w * abs(w) / _TURN_ACCELERATION_RAD_S2
    bearing = math.atan2(goal[1] - y, goal[0] - x)
    heading = 1.0 - abs(wrapped(bearing - theta)) / math.pi
    speed = max(1.0 - abs(v - wanted) / numbers.top_speed_m_s, 0.0)
    value = heading_gain * heading + distance_gain * distance + speed_gain * speed
    return max(value, 1e-9)


@njit(cache=True)
def _smoothed(values: Any, i: int, j: int) -> float:  # pragma: no cover  (compiled)
    """Returns the mean of a value and of its neighbors that are numbers."""
    total, count = 0.0, 0
    for a in range(max(i - 1, 0), min(i + 2, values.shape[0])):
        for b in range(max(j - 1, 0), min(j + 2, values.shape[1])):
            if not math.isnan(values[a, b]):
                total += values[a, b]
                count += 1
    return total / count


@njit(cache=True)
def _wanted_speeds(
    pose: Any, approach: Approach
) -> tuple[float, float]:  # pragma: no cover  (compiled)
    """Returns the least and the wanted speed, m/s.

    The robot may back off to get away from obstacles. If the local goal is far off its
    heading, it turns before it drives.
    """
    wanted, least = approach.speed_m_s, SPEED_LIMITS[0]
    if wanted < 0.0:
        return wanted, wanted
    bearing = math.atan2(approach.y - pose[1], approach.x - pose[0])
    return least, slowed_by(wrapped(bearing - pose[2]), wanted)


@register_jitable
def dynamic_window_step(
    tick: int,
    state: DynamicWindowState,
    inputs: Any,
    outputs: Any,
    numbers: DynamicWindowNumbers,
) -> None:
    """Computes speed and yaw rate of the robot for one control period."""
    pose, motion = inputs[3], state.motion
    if tick % numbers.period_ticks == 0:
        approach = approach_on_route(tick, inputs, state.route, numbers.route)
        cells = occupied_around(inputs, _REACH_M)
        now, at = (motion[0], motion[1]), (pose[0], pose[1], pose[2])
        goal = approach.x, approach.y, approach.reach_m
        if approach.speed_m_s == 0.0:
            motion[0], motion[1] = _braked(now)
        else:
            speeds = _wanted_speeds(at, approach)
            motion[0], motion[1] = choose_in_window(
                cells, at, now, speeds, goal, numbers.window
            )
    outputs[0][0], outputs[0][1] = motion[0], motion[1]


class DynamicWindowController(MapController):
    """Chooses a motion that the robot can reach and from which it can stop in time.

    The block plans a route to the target on its map, as move_base does, and drives
    toward a point of the route (``systems.planning.route_approach``). Ten times per
    second, it considers the speeds and yaw rates that the robot can reach with its
    accelerations. It keeps those from which the robot can brake before its body covers
    an occupied cell. It then chooses the motion with the largest weighted sum of
    heading, distance, and speed (see ``choose_in_window``). Objective and gains are
    those of the paper.

    The block differs from the paper in these points:

    - The heading points to the local goal on the route, not to the target. If the local
      goal is far off the heading, the robot turns before it drives.
    - The speed term rewards speeds near the wanted speed, because a follower must not
      arrive at full speed.
    - The way to brake contains the way of one period and of the motors' lag.
    - The distance along an arc counts up to half a circle and up to the local goal, so
      that circles do not count as long ways.
    - A robot that has arrived brakes to rest.
    - The obstacles are cells of a map instead of lines. A cell is occupied if an echo
      came from it and no sensor has seen it free since.

    The state contains the previous motion and the route. There is no latency.

    Args:
        robot: Size of the body, and position of the control point P ahead of the axle.
        attraction: ``AttractionParameters``. The block uses only the follow distance.
        gains: ``DynamicWindowParameters``.
        guard: Parameters of the map.
        plant: Lag of the motors.
        tick_s: Control period, s.

    Reference: Fox, Burgard and Thrun, The dynamic window approach to collision
    avoidance, IEEE Robotics and Automation Magazine 4 (1), 1997.
    """

    def __init__(
        self,
        *,
        robot: RobotParameters = RobotParameters(),
        attraction: AttractionParameters = AttractionParameters(),
        gains: DynamicWindowParameters = DynamicWindowParameters(),
        guard: GuardParameters = GuardParameters(),
        plant: PlantParameters = PlantParameters(),
        tick_s: float = TICK_S,
    ) -> None:
        super().__init__()
        self.set_name("dynamic_window_controller")
        body = half_size(robot)
        window = WindowNumbers(
            (gains.heading_gain, gains.distance_gain, gains.speed_gain),
            body,
            gains.clearance_m,
            0.5 * robot.wheel_separation_m,
            robot.top_speed_m_s,
            plant.motor_lag_s + tick_s,
        )
        follow = FollowNumbers(attraction.follow_distance_m, robot.control_point_m)
        numbers = DynamicWindowNumbers(
            window,
            route_numbers(follow, body[1] + gains.clearance_m, tick_s),
            max(round(_PERIOD_S / tick_s), 1),
        )
        route = route_state(guard.cells_for(body_radius(robot)))
        state = DynamicWindowState(np.zeros(2), route)
        self.declare(Step(dynamic_window_step, numbers, state), tick_s=tick_s)
