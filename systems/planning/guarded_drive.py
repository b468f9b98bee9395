"""One tick of the guarded law: where to drive, when to look, and how to evade bodies.

The robot is in one of five modes. It waits without a target. It drives along the path
that `systems.planning.way` finds. It looks around before it moves for the first time,
and it looks at a place that blocks it. It backs off after it has stayed in one place
for too long. It gives up temporarily if all paths lead through occupied cells. In every
mode, `systems.planning.evasion` may replace the motion to avoid moving bodies.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from systems.framework.compiling import njit
from systems.planning.carrot import find_carrot
from systems.planning.evasion import EvasionNumbers, choose_motion
from systems.planning.following import BACK_SPEED_M_S, wanted_speed
from systems.planning.hazards import (
    MOVED_S,
    Hazards,
    HazardSensors,
    find_movers,
    pick_hazards,
    track_hazards,
)
from systems.planning.turning import TURN_GAIN, TURN_RATE_RAD_S, turn_towards, wrapped
from systems.planning.way import NEAR, OCCUPIED, TIGHT, Way, find_way, mark_blocked
from systems.safety.braking import TURNED
from systems.safety.free_space import ROLLED, FreeSpace, edge_cells

#: Modes of the robot.
WAITING, DRIVING, LOOKING, BACKING, GIVING_UP = range(5)
#: Indices of ``DriveState.memory``: times in s, positions in m, headings in rad.
(
    HAS_BEGUN,  # 1 after the first tick
    SPEED,  # wanted forward speed, m/s
    TURN,  # wanted yaw rate, rad/s
    MODE,  # WAITING to GIVING_UP
    CARROT_X,  # point of the path to which the robot heads
    CARROT_Y,
    WAY_LEFT,  # remaining length of the path, m
    PLANNED_S,  # time of the last plan
    BLOCKED_S,  # last time when the guard let the robot go on
    STAYS_X,  # position of the robot when it last moved on
    STAYS_Y,
    STAYS_S,  # time when it last moved on
    HAS_LOOKED,  # 1 after the first look around
    FIRST_LOOK,  # headings of the current look
    SECOND_LOOK,
    LOOKS_DONE,  # number of headings of the current look that are done
    BLOCK_X,  # cell that blocks the robot
    BLOCK_Y,
    BACKED_S,  # start of backing off
    HELD,  # speed that the guard last refused, m/s, or 0
    HELD_S,  # time of this refusal
    PASSABLE_S,  # time of the last path without occupied cells
    MEMORY,  # number of entries
) = range(23)

#: Half of the angle of a look, rad: for the first look, before the robot has moved; and
#: for a look at a cell that blocks the robot.
_FIRST_LOOK_RAD, _LOOK_RAD = 0.4, 0.6
#: A heading of a look is done if the heading error is below the first number, rad. The
#: second number is the yaw rate per heading error during a look, 1/s.
_LOOKED_RAD, _LOOK_GAIN = 0.1, 4.0
#: A look ends early if the distance of the disc from non-free space exceeds the
#: required distance by this much, m.
_ROOM_M = 0.03
#: If the heading error is larger than this angle, rad, the robot turns before it
#: drives.
_TURN_FIRST_RAD = 1.0
#: A robot that has moved farther than this distance, m, does not stay in one place.
_STAYS_M = 0.15
#: The robot has arrived if the error of its distance from the target is below the first
#: number, m, and the target is slower than the second number, m/s.
_THERE_M, _RESTS_M_S = 0.2, 0.1
#: A path is straight if its length is at most this multiple of the direct distance.
_DETOUR = 1.15
#: Duration of backing off, s.
_BACKING_S = 2.0
#: Time after the detection of a moving body in which the robot weaves more widely, s.
_MOVES_S = 5.0
#: The robot weaves less if it lags behind the target. The reduction starts at the first
#: lag and is complete at the second, m.
_LITTLE_BEHIND_M, _FAR_BEHIND_M = 0.3, 0.9
#: Distance within which the robot evades bodies, m. If the need to watch bodies is
#: below the second number, the robot does not evade.
_NEAR_M, _WATCHED = 3.5, 0.05
#: After the guard has refused a speed, the robot avoids it for this time, s.
_HELD_S = 0.4
#: Largest number of cells that are compared to find the one that blocks the robot.
_MOST_CELLS = 1_000


class DriveState(NamedTuple):
    """State of the guarded law between two ticks."""

    memory: NDArray[np.float64]
    """(1, MEMORY) values at the indices from ``HAS_BEGUN`` to ``PASSABLE_S``."""
    way: Way
    hazards: Hazards


class DriveNumbers(NamedTuple):
    """Constants of one tick."""

    own: Any
    """``GuardedParameters``."""
    follow_distance_m: float
    control_point_m: float
    """Distance of P ahead of the axle, m."""
    sensors: HazardSensors
    evasion: EvasionNumbers
    radius_m: float
    """Radius of the disc for which paths are planned, m."""
    tick_s: float


@njit(cache=True)
def _within(value: float, limit: float) -> float:  # pragma: no cover  (compiled)
    return min(max(value, -limit), limit)


@register_jitable
def drive_guarded(
    tick: int, state: DriveState, inputs: Any, numbers: DriveNumbers
) -> None:
    """Decides which speed and yaw rate the robot wants in one tick.

    The function writes ``SPEED`` and ``TURN`` of the memory. It works in these steps:

    1. Update the tracks of moving bodies with the new echoes.
    2. Plan a path at regular intervals, and compute the wanted speed and heading error.
    3. Update three timers: how long the robot has stayed in one place, how long the
       guard has blocked the robot, and how long all paths have led through occupied
       cells.
    4. Change the mode if a timer has expired, and compute the motion of this mode.
    5. Replace this motion if moving bodies are near (``_evade``).

    Args:
        tick: Number of the tick.
        state: Modified in place.
        inputs: Position and velocity of the target, m and m/s; whether there is a
            target; pose of the robot, m and rad; report of the guard; ranges, echoes
            and ages of the range sensors; free space.
        numbers: Constants.
    """
    target, velocity, valid = inputs[0], inputs[1], inputs[2][0]
    pose, report, space = inputs[3], inputs[4], inputs[8]
    m, own, time = state.memory, numbers.own, tick * numbers.tick_s
    if m[0, HAS_BEGUN] < 0.5:
        # First tick: start all timers, and plan at once.
        m[0, PLANNED_S], m[0, BLOCKED_S], m[0, PASSABLE_S] = -np.inf, time, time
        _stays(m, pose, time)
        m[0, HAS_BEGUN] = 1.0
    _remember_held(m, report, time)
    m[0, SPEED], m[0, TURN] = 0.0, 0.0
    # Without a target, no echo is attributed to it.
    nowhere = np.inf, np.inf
    x, y = (target[0], target[1]) if valid > 0.5 else nowhere
    followed = x, y, own.source_radius_m
    readings = inputs[5], inputs[6], inputs[7]
    track_hazards(state.hazards, time, pose, readings, space, followed, numbers.sensors)
    # No target: stand still, but evade.
    if valid < 0.5:
        m[0, MODE], m[0, BLOCKED_S], m[0, PASSABLE_S] = WAITING, time, time
        _stays(m, pose, time)
        _evade(time, pose, 0.0, 0.0, state, numbers)
        return
    wanted, error, there = _find_heading(
        time, target, velocity, pose, state, space, numbers
    )
    # Timer 1: how long the robot has stayed in one place.
    if math.hypot(pose[0] - m[0, STAYS_X], pose[1] - m[0, STAYS_Y]) > _STAYS_M or there:
        _stays(m, pose, time)
    # Timer 2: how long the guard has blocked the robot. A guard that passes the
    # command, or only slows the robot, does not block the robot.
    if report[0] < TURNED or there or wanted <= 0.0:
        m[0, BLOCKED_S] = time
    # Timer 3: how long all paths have led through occupied cells.
    if time - m[0, PASSABLE_S] > own.search_way_s and not there:
        m[0, MODE], m[0, BLOCKED_S] = GIVING_UP, time
        _stays(m, pose, time)
        _evade(time, pose, 0.0, 0.0, state, numbers)
        return
    if m[0, MODE] == WAITING or m[0, MODE] == GIVING_UP:
        m[0, MODE] = DRIVING
    if m[0, MODE] == DRIVING:
        _begin_look(time, pose, pose[2] + error, state, space, numbers)
    if m[0, MODE] == LOOKING:
        _look(time, pose, report, state, numbers)
    # The robot has stayed in one place for too long. It marks the place in front of it
    # as blocked, backs off, and plans a new path.
    if m[0, MODE] == DRIVING and time - m[0, STAYS_S] > own.give_up_s:
        ahead, at = pose[2] + error, numbers.radius_m + 0.1
        place = pose[0] + at * math.cos(ahead), pose[1] + at * math.sin(ahead)
        mark_blocked(state.way, place, time + own.mark_s)
        m[0, MODE], m[0, BACKED_S], m[0, PLANNED_S] = BACKING, time, -np.inf
    if m[0, MODE] == BACKING:
        m[0, SPEED] = -BACK_SPEED_M_S
        if time - m[0, BACKED_S] > _BACKING_S:
            m[0, MODE], m[0, BLOCKED_S] = DRIVING, time
            _stays(m, pose, time)
    if m[0, MODE] == DRIVING:
        _drive(time, velocity, wanted, error, there, state, numbers)
    _evade(time, pose, wanted, error, state, numbers)


@njit(cache=True)
def _remember_held(
    m: Any, report: Any, time: float
) -> None:  # pragma: no cover  (compiled)
    """Remember the speed that the guard has refused in the last tick."""
    if report[0] >= TURNED and m[0, SPEED] != 0.0:
        m[0, HELD], m[0, HELD_S] = m[0, SPEED], time
    elif time - m[0, HELD_S] > _HELD_S:
        m[0, HELD] = 0.0


@register_jitable
def _evade(time, pose, wanted, error, state, numbers):  # type: ignore[no-untyped-def]
    """Replace speed and turn if a moving body may come near.

    The function first computes the weaving heading from the current turn.
    ``choose_motion`` compares other headings with this heading. A look at a blocked
    place ends when the robot has to evade. The first look around continues.
    """
    m, hazards = state.memory, state.hazards
    count = pick_hazards(hazards, time, pose, _NEAR_M)
    if count == 0:
        return
    # The current yaw rate is the gain times the error of the weaving heading.
    weaving = pose[2] + m[0, TURN] / TURN_GAIN
    way = wanted, pose[2] + error, weaving
    speed, heading, watched = choose_motion(
        hazards.picked, count, pose, way, m[0, HELD], numbers.evasion
    )
    if watched < _WATCHED:
        return
    if m[0, MODE] == LOOKING and m[0, HAS_LOOKED] > 0.5:
        m[0, MODE], m[0, BLOCKED_S] = DRIVING, time
    m[0, SPEED] = speed
    m[0, TURN] = turn_towards(0.0, heading, pose[2])[1]


@njit(cache=True)
def _stays(m: Any, pose: Any, time: float) -> None:  # pragma: no cover  (compiled)
    """Restart the timer that measures how long the robot stays in one place."""
    m[0, STAYS_X], m[0, STAYS_Y], m[0, STAYS_S] = pose[0], pose[1], time


@register_jitable
def _find_heading(  # type: ignore[no-untyped-def]
    time, target, velocity, pose, state, space, numbers
):
    """Return wanted speed, m/s, heading error, rad, and whether the robot has arrived.

    A new path is planned every ``replan_s``. Echoes near the target and near tracked
    bodies do not block the path. The robot heads to the carrot: the farthest point of
    the path that a straight drive reaches as cheaply (``find_carrot``). The wanted
    speed depends on the distance from the target minus the follow distance. The
    distance from the target is the length of the path. If the path is almost straight,
    the direct distance replaces this length.
    """
    m, own, way, hazards = state.memory, numbers.own, state.way, state.hazards
    x, y, theta = pose[0], pose[1], pose[2]
    if time - m[0, PLANNED_S] >= own.replan_s - 0.5 * numbers.tick_s:
        goal = target[0], target[1]
        clear = np.empty((1 + len(hazards.tracks), 3))
        clear[0, 0], clear[0, 1], clear[0, 2] = *goal, own.source_clearance_m
        count = 1 + find_movers(hazards, time, clear[1:])
        radius = numbers.radius_m
        find_way(way, space, (x, y), goal, time, radius, clear[:count])
        m[0, PLANNED_S] = time
        if way.facts[0, 2] < OCCUPIED:
            m[0, PASSABLE_S] = time
    # Distance from P to the target.
    follow, offset = numbers.follow_distance_m, numbers.control_point_m
    dx = target[0] - x - offset * math.cos(theta)
    dy = target[1] - y - offset * math.sin(theta)
    distance, length = math.hypot(dx, dy), way.facts[0, 1]
    carrot = find_carrot(way, x, y, own.look_ahead_m)
    left = max(distance, length - offset)
    direct = math.hypot(target[0] - x, target[1] - y)
    # A path over cells is longer than the straight line, even without obstacles. If the
    # path avoids nothing, the direct distance counts. Close to the target, the robot
    # heads to the target itself.
    if way.facts[0, 2] <= TIGHT and length < _DETOUR * direct:
        left = distance
        if distance < follow + 3.0 * _THERE_M:
            carrot = target[0], target[1]
    bearing = math.atan2(carrot[1] - y, carrot[0] - x)
    # Speed of the target away from the robot.
    along = velocity[0] * math.cos(bearing) + velocity[1] * math.sin(bearing)
    wanted = wanted_speed(left - follow, along)
    rests = math.hypot(velocity[0], velocity[1]) < _RESTS_M_S
    m[0, CARROT_X], m[0, CARROT_Y], m[0, WAY_LEFT] = carrot[0], carrot[1], left
    return wanted, wrapped(bearing - theta), rests and abs(left - follow) < _THERE_M


@register_jitable
def _begin_look(  # type: ignore[no-untyped-def]
    time, pose, ahead, state, space, numbers
):
    """Begin a look before the robot first moves, or when the guard blocks it.

    The first look is centered on the direction of the path. A later look is centered on
    the cell that blocks the robot, as seen from P. The later look begins after the
    guard has blocked the robot for ``patience_s``. The robot first turns to the nearer
    side.
    """
    m, x, y = state.memory, pose[0], pose[1]
    half = _FIRST_LOOK_RAD
    if m[0, HAS_LOOKED] > 0.5:
        if time - m[0, BLOCKED_S] <= numbers.own.patience_s:
            return
        offset, half = numbers.control_point_m, _LOOK_RAD
        block = _blocking(space, x, y, pose[2], numbers.radius_m)
        m[0, BLOCK_X], m[0, BLOCK_Y] = block
        px, py = x + offset * math.cos(pose[2]), y + offset * math.sin(pose[2])
        ahead = math.atan2(block[1] - py, block[0] - px)
    left, right = ahead + half, ahead - half
    if abs(wrapped(left - pose[2])) > abs(wrapped(right - pose[2])):
        left, right = right, left
    m[0, FIRST_LOOK], m[0, SECOND_LOOK] = left, right
    m[0, LOOKS_DONE], m[0, MODE] = 0.0, LOOKING


@register_jitable
def _look(time, pose, report, state, numbers):  # type: ignore[no-untyped-def]
    """Turn to both sides of the blocking cell, until there is room.

    The look ends as soon as the guard reports room. If the robot has turned to both
    sides and there is no room, it marks the cell as blocked for ``mark_s``. Then it
    plans a new path and drives. The first look around always turns to both sides and
    marks nothing.
    """
    m, own = state.memory, numbers.own
    first = m[0, HAS_LOOKED] < 0.5
    heading = m[0, FIRST_LOOK] if m[0, LOOKS_DONE] < 0.5 else m[0, SECOND_LOOK]
    to = wrapped(heading - pose[2])
    m[0, TURN] = _within(_LOOK_GAIN * to, TURN_RATE_RAD_S)
    if abs(to) < _LOOKED_RAD:
        m[0, LOOKS_DONE] += 1.0
    seen = not first and report[1] > _ROOM_M
    if m[0, LOOKS_DONE] > 1.5 or seen:
        if not first and not seen:
            place = m[0, BLOCK_X], m[0, BLOCK_Y]
            mark_blocked(state.way, place, time + own.mark_s)
        m[0, MODE], m[0, BLOCKED_S], m[0, PLANNED_S] = DRIVING, time, -np.inf
        m[0, HAS_LOOKED] = 1.0


@njit(cache=True)
def _blocking(
    space: FreeSpace, x: float, y: float, theta: float, radius: float
) -> tuple[float, float]:  # pragma: no cover  (compiled)
    """Return the middle of the non-free cell nearest to a point ahead of the axle.

    The point is 0.1 m ahead. If all cells are free, the function returns this point.
    """
    corners = np.empty((_MOST_CELLS, 2))
    count = edge_cells(space, x, y, radius + 0.3, space.facts[0, ROLLED], corners)
    ahead = x + 0.1 * math.cos(theta), y + 0.1 * math.sin(theta)
    best, found, half = np.inf, ahead, 0.5 * space.cell_m
    for k in range(min(count, _MOST_CELLS)):
        middle = corners[k, 0] + half, corners[k, 1] + half
        distance = math.hypot(middle[0] - ahead[0], middle[1] - ahead[1])
        if distance < best:
            best, found = distance, middle
    return found


@register_jitable
def _drive(  # type: ignore[no-untyped-def]
    time, velocity, wanted, error, there, state, numbers
):
    """Drive towards the carrot.

    The heading weaves around the direction of the carrot, so that the range sensors
    sweep the floor beside the path. The robot weaves more widely in two cases. In the
    first case, the target moves and the path is not narrow. In the second case, a
    moving body was detected within the last ``_MOVES_S``. In both cases, a robot that
    lags behind the target weaves less. With a large heading error, the robot only
    turns.
    """
    m, own = state.memory, numbers.own
    if there:
        m[0, SPEED], m[0, TURN] = wanted, 0.5 * TURN_GAIN * error
        return
    weave = 0.0
    if wanted > 0.0:
        width, period = own.weave_rad, own.weave_period_s
        moves = math.hypot(velocity[0], velocity[1]) > _RESTS_M_S
        narrow = state.way.facts[0, 2] >= NEAR
        recent = time - state.hazards.memory[0, MOVED_S] < _MOVES_S
        if recent or (moves and not narrow):
            # Weave widely, but less if the robot lags behind the target.
            behind = m[0, WAY_LEFT] - numbers.follow_distance_m - _LITTLE_BEHIND_M
            part = min(max(behind / (_FAR_BEHIND_M - _LITTLE_BEHIND_M), 0.0), 1.0)
            width = own.search_rad * (1.0 - own.search_less * part)
            period = own.search_period_s
        weave = width * math.sin(math.tau * time / period)
    turn = TURN_GAIN * wrapped(error + weave)
    m[0, TURN] = _within(turn, TURN_RATE_RAD_S)
    m[0, SPEED] = wanted
    if wanted > 0.0:
        m[0, SPEED] *= math.cos(error) if abs(error) < _TURN_FIRST_RAD else 0.0
