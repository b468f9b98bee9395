"""Baseline: the dynamic window approach of Fox, Burgard and Thrun, 1997."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from systems.base.robot import RobotParameters
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
from systems.planning.following import SPEED_LIMITS, FollowNumbers, approach
from systems.planning.turning import wrapped

# ``_SPEEDS``: number of speeds in the grid over a window.
# ``_TURNS``: number of yaw rates in the grid over a window.
_SPEEDS, _TURNS = 9, 17
#: Half side of the square around the robot in which cells count, m.
_REACH_M = 2.5
#: Acceleration that limits the window, and deceleration of a robot that brakes, m/s^2.
_ACCELERATION_M_S2 = 1.0
#: Time from one choice to the next, s.
_PERIOD_S = 0.1


class WindowNumbers(NamedTuple):
    """Constants of the choice of a motion; see ``DynamicWindowParameters``."""

    gains: tuple[float, float, float]
    """Weights of heading, distance, and speed."""
    turn_acceleration_rad_s2: float
    farthest_m: float
    half_size: tuple[float, float]
    """Half of the body's length and width, m."""
    clearance_m: float
    """Distance that the body keeps from cells with echoes, m."""


class DynamicWindowNumbers(NamedTuple):
    """Constants of the step of ``DynamicWindowController``."""

    window: WindowNumbers
    follow: FollowNumbers
    period_ticks: int


@njit(cache=True)
def time_to_contact(
    places: Any, motion: tuple[float, float], half: tuple[float, float]
) -> float:  # pragma: no cover  (compiled)
    """Computes when the moving robot first covers one of several points.

    The robot keeps its speed and yaw rate. Seen from the robot, the points then move:
    straight backward if the yaw rate is zero, otherwise on circles around the center of
    the robot's arc. The function computes for each point when its line or circle first
    meets the rectangle of the body.

    Args:
        places: (n, 2) points in the body frame of the robot, m.
        motion: Speed, m/s, and yaw rate, rad/s.
        half: Half of the body's length and half of its width, m.

    Returns:
        Time of the first contact, s; infinite if there is none. Points that the body
        already covers do not count.
    """
    v, w = motion
    a, b = half
    best = np.inf
    if abs(w) < 1e-6:
        for n in range(len(places)):
            gap = math.copysign(places[n, 0], v * places[n, 0]) - a
            if v != 0.0 and gap > 0.0 and abs(places[n, 1]) <= b:
                best = min(best, gap / abs(v))
        return best
    # Center of the arc: (0, turn). Only radii from least to most meet the body.
    turn = v / w
    least, most = max(abs(turn) - b, 0.0), math.hypot(a, abs(turn) + b)
    for n in range(len(places)):
        x, y = places[n, 0], places[n, 1] - turn
        far = math.hypot(x, y)
        if far < least or far > most or (abs(x) <= a and abs(places[n, 1]) <= b):
            continue
        angle = _angle_to_contact(x, y, far, turn, half, -w)
        best = min(best, angle / abs(w))
    return best


@njit(cache=True)
def _angle_to_contact(
    x: float, y: float, far: float, turn: float, half: tuple[float, float], sign: float
) -> float:  # pragma: no cover  (compiled)
    """Computes the angle by which a point turns about (0, 0) until it meets the body.

    The point starts at (x, y) and keeps the distance ``far`` from (0, 0). The center of
    the body is at (0, -turn). The point turns counterclockwise if ``sign`` is positive.
    """
    a, b = half
    begin, best = math.atan2(y, x), np.inf
    for side in (1.0, -1.0):
        for other in (1.0, -1.0):
            # Crossing of the front or rear side.
            if far >= a:
                ey = other * math.sqrt(far * far - a * a)
                if abs(ey + turn) <= b:
                    off = math.atan2(ey, side * a) - begin
                    best = min(best, math.copysign(1.0, sign) * off % math.tau)
            # Crossing of the left or right side.
            ey = side * b - turn
            if far >= abs(ey):
                ex = other * math.sqrt(far * far - ey * ey)
                if abs(ex) <= a:
                    off = math.atan2(ey, ex) - begin
                    best = min(best, math.copysign(1.0, sign) * off % math.tau)
    return best


@njit(cache=True)
def _in_body_axes(
    places: Any, pose: Any, half: tuple[float, float]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:  # pragma: no cover  (compiled)
    """Returns points in B, m: first those outside the rectangle, then those inside."""
    found, beyond, within = np.empty((len(places), 2)), 0, len(places)
    c, s = math.cos(pose[2]), math.sin(pose[2])
    for n in range(len(places)):
        dx, dy = places[n, 0] - pose[0], places[n, 1] - pose[1]
        x, y = c * dx + s * dy, c * dy - s * dx
        if abs(x) <= half[0] and abs(y) <= half[1]:
            within -= 1
            found[within] = x, y
        else:
            found[beyond] = x, y
            beyond += 1
    return found[:beyond], found[within:]


@njit(cache=True)
def choose_in_window(
    places: Any,
    pose: Any,
    now: tuple[float, float],
    wanted: float,
    bearing: float,
    numbers: WindowNumbers,
) -> tuple[float, float]:  # pragma: no cover  (compiled)
    """Chooses speed and yaw rate by the dynamic window approach (Fox, eq. 13-15).

    The window contains all speeds and yaw rates that the robot can reach in one period.
    The function tries a grid of these motions. It rejects a motion if the robot could
    not brake to rest before it covers an occupied cell. From the remaining motions, it
    chooses the motion with the largest weighted sum of three terms. The terms reward:

    - heading: a small angle between the heading after the motion and the target
    - distance: a long way to the first contact
    - speed: a speed near the wanted speed

    Args:
        places: (n, 3) occupied cells: x and y in the world frame W, m, and the
            certainty, 0 to 1 (not used).
        pose: Pose (x, y, theta) of the axle in W, m and rad.
        now: Present speed, m/s, and present yaw rate, rad/s.
        wanted: Wanted speed toward the target, m/s.
        bearing: Direction of the target in W, rad.
        numbers: Weights and limits.

    Returns:
        Speed, m/s, and yaw rate, rad/s. If the function rejects all motions, it returns
        the lowest speed of the window and the yaw rate nearest to zero.
    """
    # The window.
    heading_gain, distance_gain, speed_gain = numbers.gains
    turn_braking = numbers.turn_acceleration_rad_s2
    least, most, turn = SPEED_LIMITS
    dv, dw = _ACCELERATION_M_S2 * _PERIOD_S, turn_braking * _PERIOD_S
    low = max(now[0] - dv, least if wanted < 0.0 else 0.0)
    high = max(min(now[0] + dv, most), low)
    right, left = max(now[1] - dw, -turn), min(now[1] + dw, turn)
    # The slowest motion is the fallback.
    slower = min(max(0.0, now[1] - dw), now[1] + dw)
    found, best = (low, slower), -np.inf
    body, kept = numbers.half_size, numbers.clearance_m
    wide = body[0] + kept, body[1] + kept
    around, near = _in_body_axes(places, pose, wide)
    for i in range(_SPEEDS):
        v = low + (high - low) * i / (_SPEEDS - 1)
        for j in range(_TURNS):
            w = right + (left - right) * j / (_TURNS - 1)
            # Points outside the clearance must stay outside it. Points already inside
            # the clearance must stay outside the body.
            contact = time_to_contact(around, (v, w), wide)
            contact = min(contact, time_to_contact(near, (v, w), body))
            # The paper requires v <= sqrt(2 dist a). With dist = v t this condition is
            # t >= v/(2 a). The yaw rate has the same condition.
            stops = max(abs(v) / _ACCELERATION_M_S2, abs(w) / turn_braking)
            if contact < 0.5 * stops:
                continue
            distance = numbers.farthest_m
            if contact < np.inf:
                distance = min(abs(v) * contact, distance)
            # The heading when the robot has stopped its turn after this period.
            theta = pose[2] + w * _PERIOD_S + 0.5 * w * abs(w) / turn_braking
            heading = 1.0 - abs(wrapped(bearing - theta)) / math.pi
            value = heading_gain * heading
            value += distance_gain * distance / numbers.farthest_m
            value -= speed_gain * abs(v - wanted) / most
            if value > best:
                best, found = value, (v, w)
    return found


@register_jitable
def dynamic_window_step(
    tick: int, state: Any, inputs: Any, outputs: Any, numbers: DynamicWindowNumbers
) -> None:
    """Computes speed and yaw rate of the robot for one control period.

    The state contains the previous choice of both: speed, m/s, and yaw rate, rad/s.
    """
    pose = inputs[3]
    if tick % numbers.period_ticks == 0:
        wanted, bearing = approach(inputs, numbers.follow)
        places = occupied_around(inputs, _REACH_M)
        now, at = (state[0], state[1]), (pose[0], pose[1], pose[2])
        state[0], state[1] = choose_in_window(
            places, at, now, wanted, bearing, numbers.window
        )
    outputs[0][0], outputs[0][1] = state[0], state[1]


class DynamicWindowController(MapController):
    """Chooses a motion that the robot can reach and from which it can stop in time.

    Ten times per second, the block considers the speeds and yaw rates that the robot
    can reach with its accelerations. It keeps those from which the robot can brake
    before its body covers an occupied cell. It then chooses the motion with the largest
    weighted sum of heading, distance, and speed (see ``choose_in_window``).

    The block differs from the paper in two points:

    - The speed term rewards speeds near the wanted speed, because a follower must not
      arrive at full speed.
    - The obstacles are cells of a map instead of lines. A cell is occupied if an echo
      came from it and no sensor has seen it free since.

    The discrete state is the previous motion. There is no latency.

    Args:
        robot: Size of the body, and position of the control point P ahead of the axle.
        attraction: ``AttractionParameters``. The block uses only the follow distance.
        gains: ``DynamicWindowParameters``.
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
        tick_s: float = TICK_S,
    ) -> None:
        super().__init__()
        self.set_name("dynamic_window_controller")
        window = WindowNumbers(
            (gains.heading_gain, gains.distance_gain, gains.speed_gain),
            gains.turn_acceleration_rad_s2,
            gains.farthest_m,
            half_size(robot),
            gains.clearance_m,
        )
        numbers = DynamicWindowNumbers(
            window,
            FollowNumbers(attraction.follow_distance_m, robot.control_point_m),
            max(round(_PERIOD_S / tick_s), 1),
        )
        step = Step(dynamic_window_step, numbers, [0.0, 0.0])
        self.declare(step, tick_s=tick_s)
