"""How the guarded law drives and looks: one tick of its five modes."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from systems.framework.compiling import njit
from systems.planning.carrot import find_carrot
from systems.planning.evasion import EvasionNumbers, choose_motion
from systems.planning.following import wanted_speed
from systems.planning.hazards import (
    MOVED_S,
    Hazards,
    HazardSensors,
    find_movers,
    pick_hazards,
    track_hazards,
)
from systems.planning.turning import turn_towards, wrapped
from systems.planning.way import NEAR, OCCUPIED, TIGHT, Way, find_way, mark_blocked
from systems.safety.braking import TURNED
from systems.safety.free_space import ROLLED, FreeSpace, edge_cells

#: What the robot does.
WAITING, DRIVING, LOOKING, BACKING, GIVING_UP = range(5)
#: Places in ``DriveState.memory``; times in s, places in m, headings in rad.
(
    HAS_BEGUN,
    SPEED,
    TURN,
    MODE,
    CARROT_X,
    CARROT_Y,
    WAY_LEFT,
    PLANNED_S,
    BLOCKED_S,
    STAYS_X,
    STAYS_Y,
    STAYS_S,
    HAS_LOOKED,
    FIRST_LOOK,
    SECOND_LOOK,
    LOOKS_DONE,
    BLOCK_X,
    BLOCK_Y,
    BACKED_S,
    HELD,
    HELD_S,
    PASSABLE_S,
    MEMORY,
) = range(23)

#: Half of the first look around, before the robot has moved, and of one at what blocks
#: it, rad.
_FIRST_LOOK_RAD, _LOOK_RAD = 0.4, 0.6
#: A look is done within this, rad, and turns by this much of what is left each second.
_LOOKED_RAD, _LOOK_GAIN = 0.1, 4.0
#: The disc has room again, m: what blocked the way is seen free.
_ROOM_M = 0.03
#: Farther off its heading than this, the robot turns before it drives, rad.
_TURN_FIRST_RAD = 1.0
#: A robot that has come so far has not stayed, m.
_STAYS_M = 0.15
#: Within this of the follow distance of what rests it is there, m; slower rests, m/s.
_THERE_M, _RESTS_M_S = 0.2, 0.1
#: A way that is no longer than so many times the straight line is straight.
_DETOUR = 1.15
#: It backs off for so long, s.
_BACKING_S = 2.0
#: Where something was found to move, it searches for so long, s; less the farther it
#: lags behind what it follows, from the first to the second, m.
_MOVES_S = 5.0
_LITTLE_BEHIND_M, _FAR_BEHIND_M = 0.3, 0.9
#: Bodies within this are evaded, m; less than this to be watched is none.
_NEAR_M, _WATCHED = 3.5, 0.05
#: Where the guard has not let the robot go on it does not try again for so long, s.
_HELD_S = 0.4
#: Cells around the robot that may block it.
_MOST_CELLS = 1_000


class DriveState(NamedTuple):
    """What the robot remembers from tick to tick."""

    memory: NDArray[np.float64]
    """(1, MEMORY), see ``MEMORY``."""
    way: Way
    hazards: Hazards


class DriveNumbers(NamedTuple):
    """What a tick depends on."""

    own: Any
    """``GuardedParameters``."""
    following: Any
    """``FollowingParameters``."""
    follow_distance_m: float
    control_point_m: float
    """Distance of P ahead of the axle, m."""
    sensors: HazardSensors
    evasion: EvasionNumbers
    radius_m: float
    """Of the disc for which ways are searched, m."""
    tick_s: float


@njit(cache=True)
def _within(value: float, limit: float) -> float:  # pragma: no cover  (compiled)
    return min(max(value, -limit), limit)


@register_jitable
def drive_guarded(
    tick: int, state: DriveState, inputs: Any, numbers: DriveNumbers
) -> None:
    """Decides what the robot wants in a tick: ``SPEED`` and ``TURN`` of the memory.

    Args:
        tick: Its number.
        state: Changed.
        inputs: Place and velocity of the target, m and m/s, whether there is one, pose
            of the robot, m and rad, the guard's report, ranges, echoes and ages of the
            range sensors, and the free space.
        numbers: What the tick depends on.
    """
    target, velocity, valid = inputs[0], inputs[1], inputs[2][0]
    pose, report, space = inputs[3], inputs[4], inputs[8]
    m, own, time = state.memory, numbers.own, tick * numbers.tick_s
    if m[0, HAS_BEGUN] < 0.5:
        m[0, PLANNED_S], m[0, BLOCKED_S], m[0, PASSABLE_S] = -np.inf, time, time
        _stays(m, pose, time)
        m[0, HAS_BEGUN] = 1.0
    _remember_held(m, report, time)
    m[0, SPEED], m[0, TURN] = 0.0, 0.0
    nowhere = np.inf, np.inf
    x, y = (target[0], target[1]) if valid > 0.5 else nowhere
    followed = x, y, own.source_radius_m
    readings = inputs[5], inputs[6], inputs[7]
    track_hazards(state.hazards, time, pose, readings, space, followed, numbers.sensors)
    if valid < 0.5:
        m[0, MODE], m[0, BLOCKED_S], m[0, PASSABLE_S] = WAITING, time, time
        _stays(m, pose, time)
        _evade(time, pose, 0.0, 0.0, state, numbers)
        return
    wanted, error, there = _find_heading(
        time, target, velocity, pose, state, space, numbers
    )
    if math.hypot(pose[0] - m[0, STAYS_X], pose[1] - m[0, STAYS_Y]) > _STAYS_M or there:
        _stays(m, pose, time)
    if report[0] < TURNED or there or wanted <= 0.0:
        m[0, BLOCKED_S] = time
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
    if m[0, MODE] == DRIVING and time - m[0, STAYS_S] > own.give_up_s:
        ahead, at = pose[2] + error, numbers.radius_m + 0.1
        place = pose[0] + at * math.cos(ahead), pose[1] + at * math.sin(ahead)
        mark_blocked(state.way, place, time + own.mark_s)
        m[0, MODE], m[0, BACKED_S], m[0, PLANNED_S] = BACKING, time, -np.inf
    if m[0, MODE] == BACKING:
        m[0, SPEED] = -numbers.following.back_speed_m_s
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
    """Remembers at which speed the guard has not let the robot go on."""
    if report[0] >= TURNED and m[0, SPEED] != 0.0:
        m[0, HELD], m[0, HELD_S] = m[0, SPEED], time
    elif time - m[0, HELD_S] > _HELD_S:
        m[0, HELD] = 0.0


@register_jitable
def _evade(time, pose, wanted, error, state, numbers):  # type: ignore[no-untyped-def]
    """Changes speed and turn where a body may come near."""
    m, hazards = state.memory, state.hazards
    count = pick_hazards(hazards, time, pose, _NEAR_M)
    if count == 0:
        return
    weaving = pose[2] + m[0, TURN] / numbers.following.turn_gain
    way = wanted, pose[2] + error, weaving
    speed, heading, watched = choose_motion(
        hazards.picked, count, pose, way, m[0, HELD], numbers.evasion
    )
    if watched < _WATCHED:
        return
    if m[0, MODE] == LOOKING and m[0, HAS_LOOKED] > 0.5:
        m[0, MODE], m[0, BLOCKED_S] = DRIVING, time
    m[0, SPEED] = speed
    m[0, TURN] = turn_towards(0.0, heading, pose[2], numbers.following)[1]


@njit(cache=True)
def _stays(m: Any, pose: Any, time: float) -> None:  # pragma: no cover  (compiled)
    """Remembers from where and since when the robot stays."""
    m[0, STAYS_X], m[0, STAYS_Y], m[0, STAYS_S] = pose[0], pose[1], time


@register_jitable
def _find_heading(  # type: ignore[no-untyped-def]
    time, target, velocity, pose, state, space, numbers
):
    """Wanted speed, m/s, error of the heading, rad, and whether the robot is there."""
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
    follow, offset = numbers.follow_distance_m, numbers.control_point_m
    dx = target[0] - x - offset * math.cos(theta)
    dy = target[1] - y - offset * math.sin(theta)
    distance, length = math.hypot(dx, dy), way.facts[0, 1]
    carrot = find_carrot(way, x, y, own.look_ahead_m)
    left = max(distance, length - offset)
    direct = math.hypot(target[0] - x, target[1] - y)
    # Around nothing: the way on its cells is longer than it is.
    if way.facts[0, 2] <= TIGHT and length < _DETOUR * direct:
        left = distance
        if distance < follow + 3.0 * _THERE_M:
            carrot = target[0], target[1]
    bearing = math.atan2(carrot[1] - y, carrot[0] - x)
    along = velocity[0] * math.cos(bearing) + velocity[1] * math.sin(bearing)
    wanted = wanted_speed(left - follow, along, numbers.following)
    rests = math.hypot(velocity[0], velocity[1]) < _RESTS_M_S
    m[0, CARROT_X], m[0, CARROT_Y], m[0, WAY_LEFT] = carrot[0], carrot[1], left
    return wanted, wrapped(bearing - theta), rests and abs(left - follow) < _THERE_M


@register_jitable
def _begin_look(  # type: ignore[no-untyped-def]
    time, pose, ahead, state, space, numbers
):
    """The robot looks before it first moves, and where the guard stops it."""
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
    """Turns to both sides of the cell that blocks, until that is seen free."""
    m, own = state.memory, numbers.own
    first = m[0, HAS_LOOKED] < 0.5
    heading = m[0, FIRST_LOOK] if m[0, LOOKS_DONE] < 0.5 else m[0, SECOND_LOOK]
    to = wrapped(heading - pose[2])
    m[0, TURN] = _within(_LOOK_GAIN * to, numbers.following.turn_rate_rad_s)
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
    """Middle of the cell that is not free and nearest to where the robot would go."""
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
    """Towards the carrot, weaving, so that the sensors sweep what lies beside."""
    m, own = state.memory, numbers.own
    if there:
        m[0, SPEED], m[0, TURN] = wanted, 0.5 * numbers.following.turn_gain * error
        return
    weave = 0.0
    if wanted > 0.0:
        width, period = own.weave_rad, own.weave_period_s
        moves = math.hypot(velocity[0], velocity[1]) > _RESTS_M_S
        narrow = state.way.facts[0, 2] >= NEAR
        recent = time - state.hazards.memory[0, MOVED_S] < _MOVES_S
        if recent or (moves and not narrow):
            behind = m[0, WAY_LEFT] - numbers.follow_distance_m - _LITTLE_BEHIND_M
            part = min(max(behind / (_FAR_BEHIND_M - _LITTLE_BEHIND_M), 0.0), 1.0)
            width = own.search_rad * (1.0 - own.search_less * part)
            period = own.search_period_s
        weave = width * math.sin(math.tau * time / period)
    turn = numbers.following.turn_gain * wrapped(error + weave)
    m[0, TURN] = _within(turn, numbers.following.turn_rate_rad_s)
    m[0, SPEED] = wanted
    if wanted > 0.0:
        m[0, SPEED] *= math.cos(error) if abs(error) < _TURN_FIRST_RAD else 0.0
