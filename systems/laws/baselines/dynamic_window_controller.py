"""Baseline: the dynamic window approach of Fox, Burgard and Thrun, 1997."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from systems.base.robot import RobotParameters
from systems.framework.block import OBJECT, Port, Step
from systems.framework.compiling import njit
from systems.framework.signals import TICK_S
from systems.laws.baselines.baseline_controller import (
    BaselineController,
    half_size,
    speed_limits,
)
from systems.laws.dynamic_window import DynamicWindowParameters
from systems.laws.parameters import AttractionParameters
from systems.laws.repulsion import RepulsionParameters
from systems.planning.following import FollowNumbers, approach
from systems.planning.occupied import list_occupied
from systems.planning.parameters import FollowingParameters
from systems.planning.turning import wrapped

#: Speeds and yaw rates that are tried in a window.
_SPEEDS, _TURNS = 9, 17
#: Places farther off are not looked at, m.
_REACH_M = 2.5


class WindowNumbers(NamedTuple):
    """What a choice depends on; see ``DynamicWindowParameters``."""

    gains: tuple[float, float, float]
    """Of heading, distance and speed."""
    accelerations: tuple[float, float]
    """Ahead, m/s^2, and of the turn, rad/s^2."""
    limits: tuple[float, float, float]
    """Least and largest speed, m/s, and largest yaw rate, rad/s."""
    period_s: float
    farthest_m: float
    half_size: tuple[float, float]
    """Half of the body's length and width, m."""
    clearance_m: float
    """Kept off, m."""


class DynamicWindowNumbers(NamedTuple):
    """What the step of ``DynamicWindowController`` depends on."""

    own: DynamicWindowParameters
    window: WindowNumbers
    follow: FollowNumbers
    period_ticks: int


@njit(cache=True)
def time_to_contact(
    places: Any, motion: tuple[float, float], half: tuple[float, float]
) -> float:  # pragma: no cover  (compiled)
    """When a body that goes on along its arc covers a place.

    Args:
        places: (n, 2) of what must not be covered, in the body's axes from the axle, m.
        motion: Speed, m/s, and yaw rate, rad/s.
        half: Half of the body's length and width, m.

    Returns:
        s; infinite: never. Places that are covered already do not count.
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
    # About the centre of the arc, (0, turn), the places go round the body.
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
    """How far a place goes round (0, 0), to the side of the sign, until it is within.

    Within the rectangle about (0, -turn), that is.
    """
    a, b = half
    begin, best = math.atan2(y, x), np.inf
    for side in (1.0, -1.0):
        for other in (1.0, -1.0):
            # Across the front or the back, and across a side.
            if far >= a:
                ey = other * math.sqrt(far * far - a * a)
                if abs(ey + turn) <= b:
                    off = math.atan2(ey, side * a) - begin
                    best = min(best, math.copysign(1.0, sign) * off % math.tau)
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
    """Places in the body's axes, m: those beyond a rectangle, and those within."""
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
    """The admissible motion in the window that the objective likes best (eqs 13-15).

    Args:
        places: (n, 3) of what must not be covered, m.
        pose: (x, y, theta) of the axle, m and rad.
        now: Speed, m/s, and yaw rate, rad/s.
        wanted: Speed towards the target, m/s.
        bearing: Of the target in W, rad.
        numbers: Weights and limits.

    Returns:
        Speed, m/s, and yaw rate, rad/s; where nothing is admissible the slowest ones.
    """
    heading_gain, distance_gain, speed_gain = numbers.gains
    braking, turn_braking = numbers.accelerations
    least, most, turn = numbers.limits
    dv, dw = braking * numbers.period_s, turn_braking * numbers.period_s
    low = max(now[0] - dv, least if wanted < 0.0 else 0.0)
    high = max(min(now[0] + dv, most), low)
    right, left = max(now[1] - dw, -turn), min(now[1] + dw, turn)
    slower = min(max(0.0, now[1] - dw), now[1] + dw)
    found, best = (low, slower), -np.inf
    body, kept = numbers.half_size, numbers.clearance_m
    wide = body[0] + kept, body[1] + kept
    around, near = _in_body_axes(places, pose, wide)
    for i in range(_SPEEDS):
        v = low + (high - low) * i / (_SPEEDS - 1)
        for j in range(_TURNS):
            w = right + (left - right) * j / (_TURNS - 1)
            # What is nearer than is kept off already must not be touched.
            contact = time_to_contact(around, (v, w), wide)
            contact = min(contact, time_to_contact(near, (v, w), body))
            # v <= sqrt(2 dist a) with dist = v t, and the same of the turn.
            stops = max(abs(v) / braking, abs(w) / turn_braking)
            if contact < 0.5 * stops:
                continue
            distance = numbers.farthest_m
            if contact < np.inf:
                distance = min(abs(v) * contact, distance)
            # Where it heads after the period, and braking the turn.
            theta = pose[2] + w * numbers.period_s + 0.5 * w * abs(w) / turn_braking
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
    """Computes the twist. The state is the speed and yaw rate that were chosen last."""
    target, pose, own = inputs[0], inputs[3], numbers.own
    if tick % numbers.period_ticks == 0:
        wanted, bearing = approach(inputs, numbers.follow)
        clear = target[0], target[1], own.source_clearance_m
        places = list_occupied(inputs[4], pose[0], pose[1], _REACH_M, clear)
        now, at = (state[0], state[1]), (pose[0], pose[1], pose[2])
        state[0], state[1] = choose_in_window(
            places, at, now, wanted, bearing, numbers.window
        )
    outputs[0][0], outputs[0][1] = state[0], state[1]


class DynamicWindowController(BaselineController):
    """Chooses among the motions that it can reach and stop from in time.

    Each ``period_s`` it takes, of speeds and yaw rates that its accelerations let it
    reach, those from which it can brake before its rectangle covers a place that has
    echoed, and of these the one of the largest weighted sum of heading, distance and
    speed. In the place of the paper's speed stands how near it is to the wanted speed:
    a robot that follows must not arrive at full speed. In the place of its lines of
    obstacles stand cells that echoed since they were last seen free.

    Discrete state: the last motion. No latency.

    Args:
        robot: Its body, and place of P.
        attraction: The follow distance.
        repulsion: ``RepulsionParameters``; uses ``dwa``.
        following: How fast it drives and turns.
        tick_s: Period of the controller, s.

    Reference: Fox, Burgard and Thrun, The dynamic window approach to collision
    avoidance, IEEE Robotics and Automation Magazine 4 (1), 1997.
    """

    inputs = (*BaselineController.inputs, Port("free_space", OBJECT, "FreeSpace"))

    def __init__(
        self,
        *,
        robot: RobotParameters = RobotParameters(),
        attraction: AttractionParameters = AttractionParameters(),
        repulsion: RepulsionParameters = RepulsionParameters(),
        following: FollowingParameters = FollowingParameters(),
        tick_s: float = TICK_S,
    ) -> None:
        super().__init__()
        self.set_name("dynamic_window_controller")
        own = repulsion.dwa
        window = WindowNumbers(
            (own.heading_gain, own.distance_gain, own.speed_gain),
            (own.acceleration_m_s2, own.turn_acceleration_rad_s2),
            speed_limits(following),
            own.period_s,
            own.farthest_m,
            half_size(robot),
            own.clearance_m,
        )
        numbers = DynamicWindowNumbers(
            own,
            window,
            FollowNumbers(
                following, attraction.follow_distance_m, robot.control_point_m
            ),
            max(round(own.period_s / tick_s), 1),
        )
        step = Step(dynamic_window_step, numbers, [0.0, 0.0])
        self.declare(step, tick_s=tick_s)
