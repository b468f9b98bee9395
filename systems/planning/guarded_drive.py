"""Decisions of the guarded law in one control period.

The robot is in one of five modes:

- waiting, if there is no target
- driving along the route that ``systems.planning.way`` finds
- looking around, before the first motion or at a cell that blocks the robot
- backing off, after the robot has stayed in one place for too long, or if it cannot
  turn
- giving up, after all routes have led through occupied cells for too long

In every mode, ``systems.planning.evasion`` may replace the motion to avoid moving
bodies.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba.extending import register_jitable

from systems.framework.compiling import njit
from systems.planning.back_off import back_off, begin_backing
from systems.planning.drive_heading import RESTS_M_S, find_heading
from systems.planning.drive_state import (
    BACKING,
    DRIVING,
    GIVING_UP,
    LOOKING,
    WAITING,
    DriveMemory,
    DriveNumbers,
    DriveState,
    restart_stay,
)
from systems.planning.evasion import choose_motion
from systems.planning.hazards import pick_hazards, track_hazards
from systems.planning.look_around import begin_look, look_around
from systems.planning.passage import OPEN, PASSING
from systems.planning.passing import drive_in_passage
from systems.planning.turning import TURN_GAIN, slowed_by, turn_rate, wrapped
from systems.planning.way import MARK_S, NEAR, mark_blocked
from systems.safety.braking import TURNED

#: Echoes within this distance from the target count as echoes of the target, m. The
#: robot expects no other body there.
SOURCE_RADIUS_M = 0.35

# The heading of the robot weaves, so that the sensor cones sweep over the floor.
# ``_WEAVE_RAD``: amplitude of weaving to both sides, rad.
# ``_WEAVE_S``: period of weaving, s.
_WEAVE_RAD, _WEAVE_S = 0.3, 2.4
# ``_SEARCH_RAD``: amplitude of weaving while the target or another body moves, rad.
# ``_SEARCH_S``: period of weaving while the target or another body moves, s.
_SEARCH_RAD, _SEARCH_S = 1.0, 3.4
#: Time after the detection of a moving body during which the robot weaves widely, s.
_MOVES_S = 5.0
# If the robot lags behind the target, the robot weaves less.
# ``_LITTLE_BEHIND_M``: lag at which the reduction of the amplitude starts, m.
# ``_FAR_BEHIND_M``: lag at which the reduction is complete, m.
# ``_LESS``: share by which the amplitude is then smaller.
_LITTLE_BEHIND_M, _FAR_BEHIND_M, _LESS = 0.3, 0.9, 0.3

# ``_STAYS_M``: the robot stays in one place until it has moved by more than this, m.
# ``_GIVE_UP_S``: if the robot stays in one place for this time, it marks the place
#   ahead as blocked and backs off, s.
_STAYS_M, _GIVE_UP_S = 0.15, 5.5
#: If all routes lead through occupied cells, the robot searches for this time, s. After
#: this time, the robot reports that it gives up.
_SEARCH_WAY_S = 20.0

# ``_NEAR_M``: distance within which the robot evades bodies, m.
# ``_WATCHED``: least number of bodies to be watched for which the robot evades.
_NEAR_M, _WATCHED = 3.5, 0.05
#: After the guard has refused a speed, the robot avoids this speed for this time, s.
_HELD_S = 0.4


@register_jitable
def drive_guarded(
    tick: int, state: DriveState, inputs: Any, numbers: DriveNumbers
) -> None:
    """Decides which speed and yaw rate the robot wants in one control period.

    The function writes the results to the fields ``speed`` and ``turn`` of
    ``DriveMemory``. It works in these steps:

    1. Update the tracks of moving bodies with the new echoes.
    2. Plan a route every 0.5 s. Compute the wanted speed and the heading error.
    3. Update three timers: how long the robot has stayed in one place, how long the
       guard has blocked it, and how long all routes have led through occupied cells.
    4. If a timer has expired, change the mode. Compute the motion of the mode.
    5. If moving bodies are near, replace the motion (``_evade``).

    Args:
        tick: Number of the control period.
        state: State of the law. The function changes the state in place.
        inputs: Values of the input ports, in this order: position of the target, m;
            velocity of the target, m/s; whether there is a target; pose of the robot, m
            and rad; report of the guard; ranges, echoes, and ages of the range sensors;
            free space.
        numbers: Constants of the law.
    """
    target, velocity, (valid,), pose, report, ranges, echo, ages, space = inputs
    m, time = state.memory, tick * numbers.tick_s
    _remember_held(m, report, time)
    m.speed[0], m.turn[0] = 0.0, 0.0
    # Without a target, no echo is attributed to it.
    x, y = (target[0], target[1]) if valid > 0.5 else (np.inf, np.inf)
    track_hazards(
        state.hazards,
        time,
        pose,
        (ranges, echo, ages),
        space,
        (x, y, SOURCE_RADIUS_M),
        numbers.sensors,
    )
    # No target: stand still, but evade.
    if valid < 0.5:
        m.mode[0], m.blocked_s[0], m.passable_s[0] = WAITING, time, time
        restart_stay(m, pose, time)
        _evade(time, pose, 0.0, 0.0, state, numbers)
        return
    wanted, error, there = find_heading(
        time, target, velocity, pose, state, space, numbers
    )
    # Timer 1: how long the robot has stayed in one place.
    moved = math.hypot(pose[0] - m.stays_at[0], pose[1] - m.stays_at[1])
    if moved > _STAYS_M or there:
        restart_stay(m, pose, time)
    # Timer 2: how long the guard has blocked the robot. A guard that passes the
    # command, or only slows the robot, does not block the robot.
    passing = state.passage.state[0] >= PASSING
    if report[0] < TURNED or there or (wanted <= 0.0 and not passing):
        m.blocked_s[0] = time
    # Timer 3: how long all routes have led through occupied cells.
    if time - m.passable_s[0] > _SEARCH_WAY_S and not there:
        m.mode[0], m.blocked_s[0] = GIVING_UP, time
        restart_stay(m, pose, time)
        _evade(time, pose, 0.0, 0.0, state, numbers)
        return
    if m.mode[0] == WAITING or m.mode[0] == GIVING_UP:
        m.mode[0] = DRIVING
    if m.mode[0] == DRIVING and not passing:
        begin_look(time, pose, pose[2] + error, m, space, numbers)
    if m.mode[0] == LOOKING:
        look_around(time, pose, report, state)
    # The robot has stayed in one place for too long. It marks the place in front of it
    # as blocked, backs off, and plans a new route.
    if passing:
        restart_stay(m, pose, time)
    if m.mode[0] == DRIVING and time - m.stays_s[0] > _GIVE_UP_S:
        ahead, at = pose[2] + error, numbers.widths[1] + 0.1
        place = pose[0] + at * math.cos(ahead), pose[1] + at * math.sin(ahead)
        mark_blocked(state.way, place, time + MARK_S)
        state.passage.state[0] = OPEN
        begin_backing(m, time)
    if m.mode[0] == BACKING:
        back_off(m, time, pose, error, report)
    if m.mode[0] == DRIVING and passing:
        p, theta = state.passage, pose[2]
        drive_in_passage(m, p, theta, wanted, error, report[1], numbers)
    elif m.mode[0] == DRIVING:
        _drive(time, velocity, wanted, error, there, state, numbers)
    _evade(time, pose, wanted, error, state, numbers)


@njit(cache=True)
def _remember_held(
    m: DriveMemory, report: Any, time: float
) -> None:  # pragma: no cover  (compiled)
    """Remembers the speed that the guard refused in the last control period."""
    if report[0] >= TURNED and m.speed[0] != 0.0:
        m.held[0], m.held_s[0] = m.speed[0], time
    elif time - m.held_s[0] > _HELD_S:
        m.held[0] = 0.0


@register_jitable
def _evade(time, pose, wanted, error, state, numbers):  # type: ignore[no-untyped-def]
    """Replaces the wanted speed and yaw rate if a moving body may come near.

    If the robot evades during a look at a blocking cell, the look ends. A look before
    the first motion continues. The function computes the weaving heading for
    ``choose_motion`` from the wanted yaw rate.
    """
    m = state.memory
    bodies = pick_hazards(state.hazards, time, pose, _NEAR_M)
    if len(bodies.x) == 0:
        return
    # The current yaw rate is the gain times the error of the weaving heading.
    weaving = pose[2] + m.turn[0] / TURN_GAIN
    way = wanted, pose[2] + error, weaving
    speed, heading, watched = choose_motion(
        bodies, pose, way, m.held[0], numbers.half_size
    )
    if watched < _WATCHED:
        return
    if m.mode[0] == LOOKING and m.has_looked[0] > 0.5:
        m.mode[0], m.blocked_s[0] = DRIVING, time
    m.speed[0], m.turn[0] = speed, turn_rate(wrapped(heading - pose[2]))


@register_jitable
def _drive(  # type: ignore[no-untyped-def]
    time, velocity, wanted, error, there, state, numbers
):
    """Drives toward the carrot, which is a point of the route (``find_heading``).

    The heading weaves around the direction of the carrot, so that the range sensors
    sweep the floor beside the route. The robot weaves more widely after the detection
    of a moving body, and also while the target moves and the route is not narrow. This
    wider weaving is reduced if the robot lags far behind the target. If the heading
    error is large, the robot turns without driving.
    """
    m = state.memory
    if there and numbers.follow_distance_m < numbers.control_point_m:
        # This twist gives P the wanted velocity.
        m.speed[0] = wanted * math.cos(error)
        m.turn[0] = wanted * math.sin(error) / numbers.control_point_m
        return
    if there:
        m.speed[0], m.turn[0] = wanted, 0.5 * TURN_GAIN * error
        return
    weave = 0.0
    if wanted > 0.0:
        width, period = _WEAVE_RAD if numbers.creep_m_s == 0.0 else 0.0, _WEAVE_S
        moves = math.hypot(velocity[0], velocity[1]) > RESTS_M_S
        narrow = state.way.dearest[0] >= NEAR
        recent = time - state.hazards.moved_s[0] < _MOVES_S
        if recent or (moves and not narrow):
            behind = m.way_left_m[0] - numbers.follow_distance_m - _LITTLE_BEHIND_M
            part = min(max(behind / (_FAR_BEHIND_M - _LITTLE_BEHIND_M), 0.0), 1.0)
            width, period = _SEARCH_RAD * (1.0 - _LESS * part), _SEARCH_S
        weave = width * math.sin(math.tau * time / period)
    m.turn[0] = turn_rate(wrapped(error + weave))
    m.speed[0] = slowed_by(error, wanted)
