"""Choice of a speed and heading that avoid moving bodies and keep them in view.

The position of a moving body is uncertain. Therefore each body is represented by
particles, which are possible positions and velocities of the body.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from systems.framework.compiling import njit
from systems.planning.following import CRUISE_SPEED_M_S
from systems.planning.hazards import Sample
from systems.planning.turning import turn_rate, wrapped
from systems.safety.braking import SLOW_TURN_RAD_S

# ``_AHEAD_S``: duration of the prediction of motions, s.
# ``_STEP_S``: time step of the prediction, s.
_AHEAD_S, _STEP_S = 4.0, 0.2
# ``_HIT_M``: a particle nearer to the robot's body than this distance counts fully, m.
# ``_NEAR_M``: a particle farther away than this distance does not count, m.
_HIT_M, _NEAR_M = 0.15, 0.43
#: A contact at the end of the prediction counts less than a contact now, by this share.
_LATER = 0.2
# ``_THREAT_M``: a particle that comes nearer than this distance is a full threat, m.
# ``_NO_THREAT_M``: a particle that stays beyond this distance is no threat, m.
# ``_THREAT_S``: duration of the prediction of threats, s.
_THREAT_M, _NO_THREAT_M, _THREAT_S = 0.8, 1.6, 4.0
#: Factor that reduces the threat of a particle that moves away.
_GOING = 0.25
# The need to watch a track of a body is a factor without unit.
# ``_STALE_S``: the need is 1 after this time without an echo, s.
# ``_UNSURE_M_S``: the need is 1 if the standard deviation of the track's velocity is
#   1.5 times this value, m/s.
# ``_LEAST_NEED``: least need.
# ``_MOST_NEED``: largest need of a track without echoes.
_STALE_S, _UNSURE_M_S, _LEAST_NEED, _MOST_NEED = 0.8, 0.1, 0.1, 2.0
# ``_IN_VIEW_RAD``: largest angle between the heading and a threat in view, rad.
# ``_OUT_OF_VIEW_RAD``: largest angle out of view that counts, rad.
_IN_VIEW_RAD, _OUT_OF_VIEW_RAD = 0.55, 1.0
#: Speeds that are tried in addition to the wanted speed, m/s.
_SPEEDS = (-0.6, -0.4, -0.2, 0.0, 0.15, 0.3, 0.45, CRUISE_SPEED_M_S)
#: Angles between the tried headings and the wanted heading, rad.
_ASIDE = (0.0, 0.5, -0.5, 1.0, -1.0)
#: Largest angle between the wanted heading and a heading toward a threat, rad.
_GAZE_RAD = 0.8
# The guard limits the motion of the robot if a moving body is beside the robot. A body
# is beside the robot if its gap to the robot's disc is below ``_BESIDE_M`` plus a
# distance. The robot covers this distance in ``_BESIDE_S``.
# ``_BESIDE_M``: gap that counts as beside a robot at rest, m.
# ``_BESIDE_S``: time over which the motion of the robot counts, s.
# ``_BESIDE_TURN_M``: distance that a turn counts as, m/rad.
# ``_WITHDRAWS``: least share of the robot's speed that must lead away from a body
#   beside the robot.
_BESIDE_M, _BESIDE_S, _BESIDE_TURN_M, _WITHDRAWS = 0.09, 0.4, 0.2, 0.2
#: Total weight of particles that counts as a body.
_BODY_SHARE = 0.3
# Prices are losses of wanted speed.
# ``_RISK_PRICE``: price of a predicted contact with a body, m/s.
# ``_WATCH_PRICE``: price of a threat that is 1 rad out of view, m/s.
# ``_TURN_PRICE``: price of a deviation from the weaving heading, m/s per rad.
_RISK_PRICE, _WATCH_PRICE, _TURN_PRICE = 8.0, 0.7, 0.1
#: If the guard has refused a speed, the robot does not try this direction of motion
#: again at headings within this angle of its own heading, rad.
_HELD_RAD = 0.6


class Threats(NamedTuple):
    """Directions in which the robot has to look, with one entry per particle.

    A particle is one possible position and velocity of a moving body.
    """

    bearing_rad: NDArray[np.float64]
    """Bearing of the particle in W, rad."""
    watched: NDArray[np.float64]
    """Number of bodies that the robot has to watch there."""


@njit(cache=True)
def _between(
    value: float, none: float, full: float
) -> float:  # pragma: no cover  (compiled)
    """Return 1 below ``full``, 0 above ``none``, and a linear ramp between them."""
    return min(max((none - value) / (none - full), 0.0), 1.0)


@njit(cache=True)
def _is_held(
    bodies: Sample, pose: Any, motion: Any, time: float, half_size: Any
) -> bool:  # pragma: no cover  (compiled)
    """Checks whether the guard would refuse a motion because bodies are near.

    The function first moves the bodies on by ``time`` seconds. A body from which the
    robot moves away fast enough does not count.
    """
    x, y, theta = pose
    speed, omega = motion
    c, s = math.cos(theta), math.sin(theta)
    radius = math.hypot(half_size[0], half_size[1])
    near, moved = 0.0, _WITHDRAWS * max(abs(speed), radius * abs(omega))
    beside = radius + _BESIDE_M
    beside += _BESIDE_S * (abs(speed) + _BESIDE_TURN_M * abs(omega))
    for n in range(len(bodies.x)):
        dx = bodies.x[n] + time * bodies.vx[n] - x
        dy = bodies.y[n] + time * bodies.vy[n] - y
        distance = math.hypot(dx, dy)
        # The speed away from the body is a sufficient share of the speed of motion.
        withdraws = -speed * (c * dx + s * dy) >= moved * distance
        if distance < beside and not withdraws:
            near += bodies.weight[n]
    return near > _BODY_SHARE


@njit(cache=True)
def risk_of(
    bodies: Sample,
    pose: Any,
    speed: float,
    heading: float,
    half_size: tuple[float, float],
) -> float:  # pragma: no cover  (compiled)
    """Predicts how many bodies come near the robot at a given speed and heading.

    The function assumes that the robot turns to the heading and keeps the speed for 4
    s. If the guard would refuse this motion at some time, the function also predicts
    the motion that the guard permits. It then returns the larger of both risks.

    Args:
        bodies: Particles from ``pick_hazards``.
        pose: Present pose (x, y, theta) of the robot, m and rad.
        speed: Forward speed, m/s.
        heading: Heading to which the robot turns, rad.
        half_size: Half of the body's length and half of its width, m.

    Returns:
        Expected number of bodies near the robot. A body within 15 cm of the robot's
        sides counts fully. From there to 43 cm, the count falls linearly to zero.
    """
    let, held = _risk_along(bodies, pose, speed, heading, half_size, np.inf)
    if held:
        stopped, _ = _risk_along(
            bodies, pose, speed, heading, half_size, SLOW_TURN_RAD_S
        )
        return max(let, stopped)
    return let


@njit(cache=True)
def _risk_along(
    bodies: Sample,
    pose: Any,
    speed: float,
    heading: float,
    half_size: tuple[float, float],
    held_rad_s: float,
) -> tuple[float, bool]:  # pragma: no cover  (compiled)
    """Predicts the risk of a motion, and whether the guard would hold the robot.

    If ``held_rad_s`` is infinite, the robot moves as if it had no guard. Otherwise,
    where the guard would hold the robot, the robot only turns, at most at the yaw rate
    ``held_rad_s``.

    Each particle (possible position of a body) counts with its nearest approach to the
    robot's rectangle. A later approach counts less.

    Returns:
        Expected number of bodies near the robot, and whether the guard would hold it.
    """
    steps, total, held = math.ceil(_AHEAD_S / _STEP_S), 0.0, False
    x, y, theta = pose[0], pose[1], pose[2]
    worst = np.zeros(len(bodies.x))
    for k in range(steps):
        omega = turn_rate(wrapped(heading - theta))
        v, now, time = speed, k * _STEP_S, (k + 1) * _STEP_S
        guarded = held_rad_s < np.inf
        if (guarded or not held) and _is_held(
            bodies, (x, y, theta), (speed, omega), now, half_size
        ):
            held = True
            if guarded:
                v, omega = 0.0, min(max(omega, -held_rad_s), held_rad_s)
        # Move the robot by one step.
        theta += omega * _STEP_S
        c, s = math.cos(theta), math.sin(theta)
        x += v * _STEP_S * c
        y += v * _STEP_S * s
        for n in range(len(bodies.x)):
            dx = bodies.x[n] + time * bodies.vx[n] - x
            dy = bodies.y[n] + time * bodies.vy[n] - y
            # Gaps between the particle and the robot's rectangle, in B.
            u = max(abs(c * dx + s * dy) - half_size[0], 0.0)
            w = max(abs(-s * dx + c * dy) - half_size[1], 0.0)
            if u + w > 2.0 * _NEAR_M:
                continue
            near = _between(math.hypot(u, w), _NEAR_M, _HIT_M)
            worst[n] = max(worst[n], near * (1.0 - _LATER * time / _AHEAD_S))
    for n in range(len(bodies.x)):
        total += bodies.weight[n] * worst[n]
    return total, held


@njit(cache=True)
def _least_distance(
    dx: float, dy: float, ux: float, uy: float
) -> tuple[float, float]:  # pragma: no cover  (compiled)
    """Computes the least distance of two moving points in the next 4 s.

    (dx, dy) is the present relative position, m. (ux, uy) is the relative velocity,
    m/s.

    Returns:
        Least distance, m, and the time until then, s.
    """
    square, time = ux * ux + uy * uy, 0.0
    if square > 1e-6:
        time = min(max(-(dx * ux + dy * uy) / square, 0.0), _THREAT_S)
    return math.hypot(dx + time * ux, dy + time * uy), time


@njit(cache=True)
def find_threats(
    bodies: Sample, pose: Any, wanted: Any
) -> Threats:  # pragma: no cover  (compiled)
    """Computes how much the robot has to watch each particle, and in which direction.

    A particle is one possible position and velocity of a moving body. It is a threat if
    it will come near the robot, either while the robot drives as wanted or while it
    stands still. The robot has to watch a threat more if its body was not seen for a
    while, or if the body's velocity is uncertain.

    Args:
        bodies: Particles from ``pick_hazards``.
        pose: Pose (x, y, theta) of the robot, m and rad.
        wanted: Wanted speed, m/s, and wanted heading, rad.

    Returns:
        Direction of each particle, and number of bodies that the robot has to watch
        there.
    """
    speed, heading = max(wanted[0], 0.0), wanted[1]
    vx, vy = speed * math.cos(heading), speed * math.sin(heading)
    threats = Threats(np.empty(len(bodies.x)), np.empty(len(bodies.x)))
    for n in range(len(bodies.x)):
        dx, dy = bodies.x[n] - pose[0], bodies.y[n] - pose[1]
        driving, comes = _least_distance(dx, dy, bodies.vx[n] - vx, bodies.vy[n] - vy)
        standing, later = _least_distance(dx, dy, bodies.vx[n], bodies.vy[n])
        threat = _between(min(driving, standing), _NO_THREAT_M, _THREAT_M)
        # The nearest approach is now: the particle moves away.
        if comes + later < 0.2:
            threat *= _GOING
        # Need to watch: by the uncertain velocity, and by the time without an echo.
        unsure = min(max(bodies.spread_m_s[n] / _UNSURE_M_S - 0.5, _LEAST_NEED), 1.0)
        need = max(min(bodies.age_s[n] / _STALE_S, _MOST_NEED), unsure)
        threats.bearing_rad[n] = math.atan2(dy, dx)
        threats.watched[n] = bodies.weight[n] * threat * need
    return threats


@njit(cache=True)
def watch_of(threats: Threats, heading: float) -> float:  # pragma: no cover  (compiled)
    """Computes how much of the threats is out of view at a heading.

    For each threat, the function multiplies the number of bodies to be watched there by
    the angle between the threat and the field of view, rad. The angle counts up to 1
    rad. The result is the sum over all threats.

    Args:
        threats: Threats from ``find_threats``.
        heading: Heading of the robot, rad.

    Returns:
        The sum, rad.
    """
    total = 0.0
    for n in range(len(threats.watched)):
        off = abs(wrapped(threats.bearing_rad[n] - heading)) - _IN_VIEW_RAD
        total += threats.watched[n] * min(max(off, 0.0), _OUT_OF_VIEW_RAD)
    return total


@njit(cache=True)
def choose_motion(
    bodies: Sample,
    pose: Any,
    wanted: Any,
    held: float,
    half_size: tuple[float, float],
) -> tuple[float, float, float]:  # pragma: no cover  (compiled)
    """Chooses the speed and heading with the lowest price.

    The price of a motion is the sum of four terms:

    - the difference between its velocity and the wanted velocity
    - a small price for the angle between its heading and the weaving heading
    - a price for the threats that are out of view at its heading
    - a price for the bodies that come near within 4 s

    The weaving heading oscillates around the heading of the route. The function tries
    several speeds at nine headings: five around the heading of the route, the present
    heading, the weaving heading, and two toward the threats. The fourth term takes long
    to compute. The function skips it if the other terms already exceed the lowest price
    so far.

    Args:
        bodies: Particles from ``pick_hazards``.
        pose: Pose (x, y, theta) of the robot, m and rad.
        wanted: Wanted speed, m/s; heading of the route, rad; and weaving heading, rad.
        held: Speed that the guard has just refused, m/s, or 0.
        half_size: Half of the body's length and half of its width, m.

    Returns:
        Speed, m/s; heading, rad; and number of bodies that the robot has to watch. If
        this number is 0, the robot has no reason to deviate from the wanted motion.
    """
    threats = find_threats(bodies, pose, (wanted[0], wanted[1]))
    watched, cosine, sine = 0.0, 0.0, 0.0
    for n in range(len(bodies.x)):
        watched += threats.watched[n]
        cosine += threats.watched[n] * math.cos(threats.bearing_rad[n])
        sine += threats.watched[n] * math.sin(threats.bearing_rad[n])
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
        # The angle off the route or off the weaving heading, whichever is smaller.
        off = min(abs(wrapped(heading - wanted[1])), weaving)
        base = _TURN_PRICE * weaving
        base += _WATCH_PRICE * watch_of(threats, heading)
        for k in range(len(_SPEEDS) + 1):
            speed = wanted[0] if k == len(_SPEEDS) else _SPEEDS[k]
            price = base + math.hypot(
                wanted[0] - speed * math.cos(off), speed * math.sin(off)
            )
            if price >= best:
                continue
            ahead = abs(wrapped(heading - pose[2])) < _HELD_RAD
            # The guard has just refused such a motion.
            if ahead and speed * held > 0.0:
                continue
            risk = risk_of(bodies, pose, speed, heading, half_size)
            price += _RISK_PRICE * risk
            if price < best:
                best, chosen = price, (speed, heading)
    return chosen[0], chosen[1], watched
