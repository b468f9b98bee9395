"""Which speed and heading keeps off bodies that move, and keeps an eye on them."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from systems.framework.compiling import njit
from systems.planning.hazards import AGE_S, SPREAD, VX, VY, WEIGHT, X, Y
from systems.planning.turning import wrapped

#: What is looked ahead, s, and in which steps.
_AHEAD_S, _STEP_S = 4.0, 0.2
#: Nearer to the body than the first a particle counts full, up to the second less, m.
_HIT_M, _NEAR_M = 0.15, 0.43
#: What is far ahead counts less, by this share at the end.
_LATER = 0.2
#: What comes nearer than the first in the next seconds is a full threat, up to the
#: second less, m.
_THREAT_M, _NO_THREAT_M, _THREAT_S = 0.8, 1.6, 4.0
#: A threat that goes away counts for this share.
_GOING = 0.25
#: A track that was not seen for so long, s, or whose velocity is known so badly, m/s,
#: has to be looked at; one that is just being watched a little all the same.
_STALE_S, _UNSURE_M_S, _LEAST_NEED, _MOST_NEED = 0.8, 0.1, 0.1, 2.0
#: A threat that is no farther off the heading is in view, rad; at most so much counts.
_IN_VIEW_RAD, _OUT_OF_VIEW_RAD = 0.55, 1.0
#: Speeds that are tried besides the wanted one, m/s.
_SPEEDS = (-0.6, -0.4, -0.2, 0.0, 0.15, 0.3, 0.45, 0.62)
#: Headings that are tried around the wanted one, rad, and limit of a gaze around it.
_ASIDE = (0.0, 0.5, -0.5, 1.0, -1.0)
_GAZE_RAD = 0.8
#: A guard that reckons with moving bodies lets a robot move on beside one within this
#: of its rim, m, and of what it goes in so long, s, a turn taken for so much of a way,
#: m, only if it gets away by this share of its way.
_BESIDE_M, _BESIDE_S, _BESIDE_TURN_M, _WITHDRAWS = 0.09, 0.4, 0.2, 0.2
#: Else it may turn slowly, rad/s. So much of a body counts as one.
_SLOW_RAD_S, _BODY_SHARE = 0.3, 0.3
#: Price of a heading that is not the wanted one, m/s a rad.
_TURN_PRICE = 0.1
#: The guard lets the robot not go on to within this of its heading, rad.
_HELD_RAD = 0.6


class EvasionNumbers(NamedTuple):
    """What a choice depends on."""

    turn_gain: float
    """Yaw rate per error of the heading, 1/s."""
    turn_rate_rad_s: float
    """The largest one, rad/s."""
    half_size: tuple[float, float]
    """Of the body's length and width, m."""
    top_speed_m_s: float
    risk_gain: float
    """Price of a body that is hit, m/s."""
    watch_gain: float
    """Price of a threat that is 1 rad out of view, m/s."""


@njit(cache=True)
def _between(
    value: float, none: float, full: float
) -> float:  # pragma: no cover  (compiled)
    """1 below ``full``, 0 above ``none``, and in between in proportion."""
    return min(max((none - value) / (none - full), 0.0), 1.0)


@njit(cache=True)
def _is_held(
    bodies: Any, count: int, pose: Any, motion: Any, time: float, numbers: Any
) -> bool:  # pragma: no cover  (compiled)
    """Whether a guard lets the robot not move so, beside bodies as they are by then."""
    x, y, theta = pose
    speed, omega = motion
    c, s = math.cos(theta), math.sin(theta)
    radius = math.hypot(numbers.half_size[0], numbers.half_size[1])
    near, moved = 0.0, _WITHDRAWS * max(abs(speed), radius * abs(omega))
    beside = radius + _BESIDE_M
    beside += _BESIDE_S * (abs(speed) + _BESIDE_TURN_M * abs(omega))
    for n in range(count):
        dx = bodies[n, X] + time * bodies[n, VX] - x
        dy = bodies[n, Y] + time * bodies[n, VY] - y
        distance = math.hypot(dx, dy)
        withdraws = -speed * (c * dx + s * dy) >= moved * distance
        if distance < beside and not withdraws:
            near += bodies[n, WEIGHT]
    return near > _BODY_SHARE


@njit(cache=True)
def risk_of(
    bodies: Any,
    count: int,
    pose: Any,
    speed: float,
    heading: float,
    numbers: EvasionNumbers,
) -> float:  # pragma: no cover  (compiled)
    """How many bodies come near the robot if it goes on so, or where a guard holds it.

    Args:
        bodies: (n, 7) from ``pick_hazards``.
        count: How many of them there are.
        pose: (x, y, theta) now, m and rad.
        speed: Ahead, m/s.
        heading: That it turns to, rad.
        numbers: The robot.

    Returns:
        Bodies: those within 15 cm of its sides full, up to 43 cm less and less.
    """
    let, held = _risk_along(bodies, count, pose, speed, heading, numbers, np.inf)
    if held:
        stopped, _ = _risk_along(
            bodies, count, pose, speed, heading, numbers, _SLOW_RAD_S
        )
        return max(let, stopped)
    return let


@njit(cache=True)
def _risk_along(
    bodies: Any,
    count: int,
    pose: Any,
    speed: float,
    heading: float,
    numbers: EvasionNumbers,
    held_rad_s: float,
) -> tuple[float, bool]:  # pragma: no cover  (compiled)
    """``risk_of``, and whether a guard would hold the robot; to which turn, if any."""
    steps, total, held = math.ceil(_AHEAD_S / _STEP_S), 0.0, False
    x, y, theta = pose[0], pose[1], pose[2]
    worst = np.zeros(count)
    for k in range(steps):
        omega = numbers.turn_gain * wrapped(heading - theta)
        omega = min(max(omega, -numbers.turn_rate_rad_s), numbers.turn_rate_rad_s)
        v, now, time = speed, k * _STEP_S, (k + 1) * _STEP_S
        guarded = held_rad_s < np.inf
        if (guarded or not held) and _is_held(
            bodies, count, (x, y, theta), (speed, omega), now, numbers
        ):
            held = True
            if guarded:
                v, omega = 0.0, min(max(omega, -held_rad_s), held_rad_s)
        theta += omega * _STEP_S
        c, s = math.cos(theta), math.sin(theta)
        x += v * _STEP_S * c
        y += v * _STEP_S * s
        for n in range(count):
            dx = bodies[n, X] + time * bodies[n, VX] - x
            dy = bodies[n, Y] + time * bodies[n, VY] - y
            u = max(abs(c * dx + s * dy) - numbers.half_size[0], 0.0)
            w = max(abs(-s * dx + c * dy) - numbers.half_size[1], 0.0)
            if u + w > 2.0 * _NEAR_M:
                continue
            near = _between(math.hypot(u, w), _NEAR_M, _HIT_M)
            worst[n] = max(worst[n], near * (1.0 - _LATER * time / _AHEAD_S))
    for n in range(count):
        total += bodies[n, WEIGHT] * worst[n]
    return total, held


@njit(cache=True)
def _least_distance(
    dx: float, dy: float, ux: float, uy: float
) -> tuple[float, float]:  # pragma: no cover  (compiled)
    """Least distance to come, m, and when, s, at a relative place and velocity."""
    square, time = ux * ux + uy * uy, 0.0
    if square > 1e-6:
        time = min(max(-(dx * ux + dy * uy) / square, 0.0), _THREAT_S)
    return math.hypot(dx + time * ux, dy + time * uy), time


@njit(cache=True)
def find_threats(
    bodies: Any, count: int, pose: Any, wanted: Any, threats: Any
) -> float:  # pragma: no cover  (compiled)
    """How much each particle has to be watched, and where it is.

    One has to if it comes near the robot, that drives as wanted or stands, and was not
    seen for a while, or its velocity is not known well.

    Args:
        bodies: (n, 7) from ``pick_hazards``.
        count: How many of them there are.
        pose: (x, y, theta) of the robot, m and rad.
        wanted: Its wanted speed, m/s, and heading, rad.
        threats: (n, 2) filled: bearing in W, rad, and bodies to be watched.

    Returns:
        Sum of the latter.
    """
    speed, heading = max(wanted[0], 0.0), wanted[1]
    vx, vy = speed * math.cos(heading), speed * math.sin(heading)
    total = 0.0
    for n in range(count):
        dx, dy = bodies[n, X] - pose[0], bodies[n, Y] - pose[1]
        driving, comes = _least_distance(dx, dy, bodies[n, VX] - vx, bodies[n, VY] - vy)
        standing, later = _least_distance(dx, dy, bodies[n, VX], bodies[n, VY])
        threat = _between(min(driving, standing), _NO_THREAT_M, _THREAT_M)
        if comes + later < 0.2:
            threat *= _GOING
        unsure = min(max(bodies[n, SPREAD] / _UNSURE_M_S - 0.5, _LEAST_NEED), 1.0)
        need = max(min(bodies[n, AGE_S] / _STALE_S, _MOST_NEED), unsure)
        threats[n, 0] = math.atan2(dy, dx)
        threats[n, 1] = bodies[n, WEIGHT] * threat * need
        total += threats[n, 1]
    return total


@njit(cache=True)
def watch_of(
    threats: Any, count: int, heading: float
) -> float:  # pragma: no cover  (compiled)
    """How much of what has to be watched is out of view at a heading.

    Args:
        threats: (n, 2) from ``find_threats``.
        count: How many of them there are.
        heading: rad.

    Returns:
        Bodies, times how far out of view they are, rad, up to 1.
    """
    total = 0.0
    for n in range(count):
        off = abs(wrapped(threats[n, 0] - heading)) - _IN_VIEW_RAD
        total += threats[n, 1] * min(max(off, 0.0), _OUT_OF_VIEW_RAD)
    return total


@njit(cache=True)
def choose_motion(
    bodies: Any,
    count: int,
    pose: Any,
    wanted: Any,
    held: float,
    numbers: EvasionNumbers,
) -> tuple[float, float, float]:  # pragma: no cover  (compiled)
    """The speed and heading of the least price.

    The price is that of not going as wanted, of what comes near within 4 s, and of what
    has to be watched and is not.

    Args:
        bodies: (n, 7) from ``pick_hazards``.
        count: How many of them there are.
        pose: (x, y, theta) of the robot, m and rad.
        wanted: Speed, m/s, heading of the way, rad, and heading that is wanted now,
            which weaves about it, rad.
        held: Speed at which the guard does not let the robot go on, m/s; 0: it does.
        numbers: The robot and the prices.

    Returns:
        Speed, m/s, heading, rad, and how much there is to watch: nothing, and there is
        no need to go otherwise than wanted.
    """
    threats = np.zeros((count, 2))
    way = wanted[0], wanted[1]
    watched = find_threats(bodies, count, pose, way, threats)
    cosine, sine = 0.0, 0.0
    for n in range(count):
        cosine += threats[n, 1] * math.cos(threats[n, 0])
        sine += threats[n, 1] * math.sin(threats[n, 0])
    gaze = math.atan2(sine, cosine)
    headings = np.empty(len(_ASIDE) + 4)
    for k in range(len(_ASIDE)):
        headings[k] = wanted[1] + _ASIDE[k]
    near = min(max(wrapped(gaze - wanted[1]), -_GAZE_RAD), _GAZE_RAD)
    headings[-4], headings[-3] = pose[2], wanted[2]
    headings[-2], headings[-1] = gaze, wanted[1] + near
    best, chosen = np.inf, (wanted[0], wanted[2])
    for heading in headings:
        weaving = abs(wrapped(heading - wanted[2]))
        off = min(abs(wrapped(heading - wanted[1])), weaving)
        base = _TURN_PRICE * weaving
        base += numbers.watch_gain * watch_of(threats, count, heading)
        for k in range(len(_SPEEDS) + 1):
            speed = wanted[0] if k == len(_SPEEDS) else _SPEEDS[k]
            price = base + math.hypot(
                wanted[0] - speed * math.cos(off), speed * math.sin(off)
            )
            if speed > numbers.top_speed_m_s or price >= best:
                continue
            ahead = abs(wrapped(heading - pose[2])) < _HELD_RAD
            if ahead and speed * held > 0.0:
                continue
            risk = risk_of(bodies, count, pose, speed, heading, numbers)
            price += numbers.risk_gain * risk
            if price < best:
                best, chosen = price, (speed, heading)
    return chosen[0], chosen[1], watched
