"""Choice of a speed and heading that avoid moving bodies and keep them in view."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from systems.framework.compiling import njit
from systems.planning.following import CRUISE_SPEED_M_S
from systems.planning.hazards import AGE_S, SPREAD, VX, VY, WEIGHT, X, Y
from systems.planning.turning import TURN_GAIN, TURN_RATE_RAD_S, wrapped

#: Duration of the prediction of motions, s, and its time step, s.
_AHEAD_S, _STEP_S = 4.0, 0.2
#: A particle nearer to the robot's body than the first distance, m, counts fully. Up to
#: the second distance, m, it counts less.
_HIT_M, _NEAR_M = 0.15, 0.43
#: A contact at the end of the prediction counts less than a contact now, by this share.
_LATER = 0.2
#: A particle that comes nearer than the first distance, m, is a full threat. Up to the
#: second distance, m, the threat decreases to zero. The third number is the duration of
#: this prediction, s.
_THREAT_M, _NO_THREAT_M, _THREAT_S = 0.8, 1.6, 4.0
#: Factor for a threat that moves away.
_GOING = 0.25
#: The need to look at a track is 1 after the first number, s, without an echo. The need
#: is also 1 if the standard deviation of the track's velocity is 1.5 times the second
#: number, m/s. The third number is the least need. The fourth number is the largest
#: need of a track without echoes.
_STALE_S, _UNSURE_M_S, _LEAST_NEED, _MOST_NEED = 0.8, 0.1, 0.1, 2.0
#: Angle off the heading within which a threat is in view, rad. Largest angle out of
#: view that counts, rad.
_IN_VIEW_RAD, _OUT_OF_VIEW_RAD = 0.55, 1.0
#: Speeds that are tried in addition to the wanted speed, m/s.
_SPEEDS = (-0.6, -0.4, -0.2, 0.0, 0.15, 0.3, 0.45, 0.62)
#: Angles between the tried headings and the wanted heading, rad. Largest angle between
#: the wanted heading and a heading towards a threat, rad.
_ASIDE = (0.0, 0.5, -0.5, 1.0, -1.0)
_GAZE_RAD = 0.8
#: A guard that allows for moving bodies checks the bodies beside the robot. A body is
#: beside the robot if its gap to the rim is below ``_BESIDE_M``, m, plus the distance
#: that the robot covers in ``_BESIDE_S``, s. A turn counts as ``_BESIDE_TURN_M`` of
#: distance, m/rad. The guard then permits only motions that lead away from the body, by
#: at least the share ``_WITHDRAWS`` of their speed.
_BESIDE_M, _BESIDE_S, _BESIDE_TURN_M, _WITHDRAWS = 0.09, 0.4, 0.2, 0.2
#: Turn rate that the guard always permits, rad/s. Total weight of particles that counts
#: as a body.
_SLOW_RAD_S, _BODY_SHARE = 0.3, 0.3
#: Price of a deviation from the wanted heading, m/s per rad.
_TURN_PRICE = 0.1
#: A speed that the guard has refused is not tried again at headings within this angle,
#: rad, of the robot's heading.
_HELD_RAD = 0.6


class EvasionNumbers(NamedTuple):
    """Constants of ``choose_motion``."""

    half_size: tuple[float, float]
    """Half of the body's length and width, m."""
    risk_gain: float
    """Price of a predicted contact with a body, m/s."""
    watch_gain: float
    """Price of a threat that is 1 rad out of view, m/s."""


@njit(cache=True)
def _between(
    value: float, none: float, full: float
) -> float:  # pragma: no cover  (compiled)
    """Return 1 below ``full``, 0 above ``none``, and a linear ramp between them."""
    return min(max((none - value) / (none - full), 0.0), 1.0)


@njit(cache=True)
def _is_held(
    bodies: Any, count: int, pose: Any, motion: Any, time: float, numbers: Any
) -> bool:  # pragma: no cover  (compiled)
    """Return whether the guard would refuse a motion because of bodies nearby.

    The function first moves the bodies on by ``time`` seconds. A body does not count if
    the robot moves away from it fast enough.
    """
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
        # The speed away from the body is a sufficient share of the speed of motion.
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
    """Predicts how many bodies come near the robot if it uses a speed and heading.

    The robot turns to the heading and keeps the speed for 4 s. The guard may refuse
    this motion at some time. The function then also predicts the motion that the guard
    permits, and returns the larger risk.

    Args:
        bodies: (n, 7) from ``pick_hazards``.
        count: Number of particles in ``bodies``.
        pose: (x, y, theta) now, m and rad.
        speed: Forward speed, m/s.
        heading: Heading to which the robot turns, rad.
        numbers: Properties of the robot.

    Returns:
        Expected number of bodies. A body counts fully within 15 cm of the robot's
        sides, and less up to 43 cm.
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
    """Return the risk of a motion, and whether the guard would hold the robot.

    ``held_rad_s`` selects the prediction. If it is infinite, the robot moves as if
    without a guard. Otherwise the robot stands wherever the guard holds it, and turns
    at most at the rate ``held_rad_s``. In each step, the function moves the robot, and
    then compares its rectangle with all particles. Each particle counts with its
    nearest approach, and a later approach counts less.
    """
    steps, total, held = math.ceil(_AHEAD_S / _STEP_S), 0.0, False
    x, y, theta = pose[0], pose[1], pose[2]
    worst = np.zeros(count)
    for k in range(steps):
        omega = TURN_GAIN * wrapped(heading - theta)
        omega = min(max(omega, -TURN_RATE_RAD_S), TURN_RATE_RAD_S)
        v, now, time = speed, k * _STEP_S, (k + 1) * _STEP_S
        guarded = held_rad_s < np.inf
        if (guarded or not held) and _is_held(
            bodies, count, (x, y, theta), (speed, omega), now, numbers
        ):
            held = True
            if guarded:
                v, omega = 0.0, min(max(omega, -held_rad_s), held_rad_s)
        # Move the robot by one step.
        theta += omega * _STEP_S
        c, s = math.cos(theta), math.sin(theta)
        x += v * _STEP_S * c
        y += v * _STEP_S * s
        for n in range(count):
            dx = bodies[n, X] + time * bodies[n, VX] - x
            dy = bodies[n, Y] + time * bodies[n, VY] - y
            # Gaps between the particle and the robot's rectangle, in B.
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
    """Return the least distance, m, in the next 4 s, and the time until then, s.

    ``(dx, dy)`` and ``(ux, uy)`` are the relative position and velocity.
    """
    square, time = ux * ux + uy * uy, 0.0
    if square > 1e-6:
        time = min(max(-(dx * ux + dy * uy) / square, 0.0), _THREAT_S)
    return math.hypot(dx + time * ux, dy + time * uy), time


@njit(cache=True)
def find_threats(
    bodies: Any, count: int, pose: Any, wanted: Any, threats: Any
) -> float:  # pragma: no cover  (compiled)
    """Finds how much the robot has to watch each particle, and in which direction.

    A particle is a threat if it will come near the robot. The function predicts the
    least distance for a robot that drives as wanted and for a robot at rest. It takes
    the smaller of both. The robot has to watch a threat that it has not seen for a
    while, or whose velocity is uncertain.

    Args:
        bodies: (n, 7) from ``pick_hazards``.
        count: Number of particles in ``bodies``.
        pose: (x, y, theta) of the robot, m and rad.
        wanted: Wanted speed, m/s, and heading, rad.
        threats: (n, 2) array that the function fills: bearing in W, rad, and number of
            bodies to be watched.

    Returns:
        Sum of the numbers of bodies to be watched.
    """
    speed, heading = max(wanted[0], 0.0), wanted[1]
    vx, vy = speed * math.cos(heading), speed * math.sin(heading)
    total = 0.0
    for n in range(count):
        dx, dy = bodies[n, X] - pose[0], bodies[n, Y] - pose[1]
        driving, comes = _least_distance(dx, dy, bodies[n, VX] - vx, bodies[n, VY] - vy)
        standing, later = _least_distance(dx, dy, bodies[n, VX], bodies[n, VY])
        threat = _between(min(driving, standing), _NO_THREAT_M, _THREAT_M)
        # The nearest approach is now: the particle moves away.
        if comes + later < 0.2:
            threat *= _GOING
        # Need to watch: by the uncertain velocity, and by the time without an echo.
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
    """Computes how much of the threats is out of view at a heading.

    Args:
        threats: (n, 2) from ``find_threats``.
        count: Number of threats.
        heading: Heading of the robot, rad.

    Returns:
        Sum over all threats of the number of bodies times the angle out of view, rad.
        Each angle counts at most 1 rad.
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
    """Chooses the speed and heading with the lowest price.

    The price of a motion is the sum of four terms:

    * the difference between its velocity and the wanted velocity;
    * the angle between its heading and the weaving heading, times a small price;
    * the threats that are out of view at this heading, times ``watch_gain``;
    * the bodies that come near within 4 s, times ``risk_gain``.

    The function tries all pairs of a heading and a speed. It uses nine headings: five
    around the heading of the path, the current heading, the weaving heading, and two
    towards the threats. The last term takes long to compute. The function skips it if
    the other terms already exceed the lowest price.

    Args:
        bodies: (n, 7) from ``pick_hazards``.
        count: Number of particles in ``bodies``.
        pose: (x, y, theta) of the robot, m and rad.
        wanted: Wanted speed, m/s; heading of the path, rad; and weaving heading, rad,
            which oscillates around the heading of the path.
        held: Speed that the guard has just refused, m/s, or 0.
        numbers: Properties of the robot, and prices.

    Returns:
        Speed, m/s; heading, rad; and the number of bodies to be watched. If the last
        number is zero, there is no reason to deviate from the wanted motion.
    """
    threats = np.zeros((count, 2))
    way = wanted[0], wanted[1]
    watched = find_threats(bodies, count, pose, way, threats)
    cosine, sine = 0.0, 0.0
    for n in range(count):
        cosine += threats[n, 1] * math.cos(threats[n, 0])
        sine += threats[n, 1] * math.sin(threats[n, 0])
    # Mean direction of the threats.
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
        # The angle off the path, or off the weaving heading if this angle is smaller.
        off = min(abs(wrapped(heading - wanted[1])), weaving)
        base = _TURN_PRICE * weaving
        base += numbers.watch_gain * watch_of(threats, count, heading)
        for k in range(len(_SPEEDS) + 1):
            speed = wanted[0] if k == len(_SPEEDS) else _SPEEDS[k]
            price = base + math.hypot(
                wanted[0] - speed * math.cos(off), speed * math.sin(off)
            )
            if speed > CRUISE_SPEED_M_S or price >= best:
                continue
            ahead = abs(wrapped(heading - pose[2])) < _HELD_RAD
            # The guard has just refused such a motion.
            if ahead and speed * held > 0.0:
                continue
            risk = risk_of(bodies, count, pose, speed, heading, numbers)
            price += numbers.risk_gain * risk
            if price < best:
                best, chosen = price, (speed, heading)
    return chosen[0], chosen[1], watched
