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
from systems.planning.evasion import choose_motion
from systems.planning.following import BACK_SPEED_M_S, wanted_speed
from systems.planning.hazards import (
    Hazards,
    find_movers,
    make_hazards,
    pick_hazards,
    track_hazards,
)
from systems.planning.looks import HazardSensors
from systems.planning.turning import (
    TURN_GAIN,
    TURN_RATE_RAD_S,
    slowed_by,
    turn_rate,
    wrapped,
)
from systems.planning.way import (
    NEAR,
    OCCUPIED,
    TIGHT,
    Way,
    find_way,
    make_way,
    mark_blocked,
)
from systems.safety.braking import TURNED
from systems.safety.free_space import FreeSpace, edge_cells

#: Modes of the robot.
WAITING, DRIVING, LOOKING, BACKING, GIVING_UP = range(5)

#: Distance that paths keep between the disc around the body and occupied cells, m.
CLEARANCE_M = 0.02
#: Distance from the target within which echoes count as echoes of the target, m. The
#: robot expects no other body there.
SOURCE_RADIUS_M = 0.35
#: Distance from the target within which echoes do not block paths, m.
_SOURCE_CLEARANCE_M = 0.85
#: Time from one plan to the next, s.
_REPLAN_S = 0.5
#: Greatest distance to the point of the path for which the robot heads, m.
_LOOK_AHEAD_M = 1.5
#: A path is straight if its length is at most this multiple of the direct distance.
_DETOUR = 1.15
#: The robot has arrived if the error of its distance from the target is below the first
#: number, m, and the target is slower than the second number, m/s.
_THERE_M, _RESTS_M_S = 0.2, 0.1

#: Amplitude of weaving to both sides, rad, and its period, s. Weaving sweeps the sensor
#: cones.
_WEAVE_RAD, _WEAVE_S = 0.3, 2.4
#: The same while the target or another body moves.
_SEARCH_RAD, _SEARCH_S = 1.0, 3.4
#: Time after the detection of a moving body in which the robot weaves more widely, s.
_MOVES_S = 5.0
#: The robot weaves less if it lags behind the target. The reduction starts at the first
#: lag, m. At the second lag, m, the amplitude is smaller by the share ``_LESS``.
_LITTLE_BEHIND_M, _FAR_BEHIND_M, _LESS = 0.3, 0.9, 0.3

#: Time for which the guard blocks the robot before the robot looks around, s.
_PATIENCE_S = 0.3
#: Half of the angle of a look, rad: for the first look, before the robot has moved; and
#: for a look at a cell that blocks the robot.
_FIRST_LOOK_RAD, _LOOK_RAD = 0.4, 0.6
#: A heading of a look is done if the heading error is below the first number, rad. The
#: second number is the yaw rate per heading error during a look, 1/s.
_LOOKED_RAD, _LOOK_GAIN = 0.1, 4.0
#: A look ends early if the distance of the disc from non-free space exceeds the
#: required distance by this much, m.
_ROOM_M = 0.03
#: Largest number of cells that are compared to find the one that blocks the robot.
_MOST_CELLS = 1_000
#: Time for which paths avoid a place that was marked as blocked, s.
_MARK_S = 10.0
#: A robot that has moved farther than the first number, m, does not stay in one place.
#: After it has stayed for the second number, s, it marks the place ahead as blocked and
#: backs off.
_STAYS_M, _GIVE_UP_S = 0.15, 5.5
#: Duration of backing off, s.
_BACKING_S = 2.0
#: Time that the robot searches while all paths lead through occupied cells, s. After
#: this time it reports that it gives up.
_SEARCH_WAY_S = 20.0

#: Distance within which the robot evades bodies, m. If the need to watch bodies is
#: below the second number, the robot does not evade.
_NEAR_M, _WATCHED = 3.5, 0.05
#: After the guard has refused a speed, the robot avoids it for this time, s.
_HELD_S = 0.4


class DriveMemory(NamedTuple):
    """What the guarded law remembers.

    Every array has one number, except for those with a form.
    """

    speed: NDArray[np.float64]
    """Wanted forward speed, m/s."""
    turn: NDArray[np.float64]
    """Wanted yaw rate, rad/s."""
    mode: NDArray[np.float64]
    """``WAITING`` to ``GIVING_UP``."""
    carrot: NDArray[np.float64]
    """(2,) point of the path to which the robot heads, m."""
    way_left_m: NDArray[np.float64]
    """Remaining length of the path, m."""
    planned_s: NDArray[np.float64]
    """Time of the last plan, s."""
    passable_s: NDArray[np.float64]
    """Time of the last path without occupied cells, s."""
    blocked_s: NDArray[np.float64]
    """Last time when the guard let the robot go on, s."""
    stays_at: NDArray[np.float64]
    """(2,) position of the robot when it last moved on, m."""
    stays_s: NDArray[np.float64]
    """Time when it last moved on, s."""
    has_looked: NDArray[np.float64]
    """1 after the first look around, else 0."""
    headings: NDArray[np.float64]
    """(2,) headings of the current look, rad."""
    looks_done: NDArray[np.float64]
    """Number of headings of the current look that are done."""
    block: NDArray[np.float64]
    """(2,) position of the cell that blocks the robot, m."""
    backed_s: NDArray[np.float64]
    """Start of backing off, s."""
    held: NDArray[np.float64]
    """Speed that the guard last refused, m/s, or 0."""
    held_s: NDArray[np.float64]
    """Time of this refusal, s."""


class DriveState(NamedTuple):
    """State of the guarded law between two ticks."""

    memory: DriveMemory
    way: Way
    hazards: Hazards


class DriveNumbers(NamedTuple):
    """Constants of one tick."""

    follow_distance_m: float
    control_point_m: float
    """Distance of P ahead of the axle, m."""
    sensors: HazardSensors
    half_size: tuple[float, float]
    """Half of the body's length and width, m."""
    radius_m: float
    """Radius of the disc for which paths are planned, m."""
    tick_s: float


def make_drive_state(cells: int, sensors: int) -> DriveState:
    """Makes the state before the first tick.

    Args:
        cells: Number of cells along a side of the map.
        sensors: Number of range sensors.

    Returns:
        The state. The robot has no plan, and has not been anywhere.
    """
    pairs = "carrot", "stays_at", "headings", "block"
    memory = DriveMemory(
        *(np.zeros(2 if name in pairs else 1) for name in DriveMemory._fields)
    )
    memory.planned_s[:], memory.stays_at[:] = -np.inf, np.inf
    return DriveState(memory, make_way(cells), make_hazards(sensors))


@register_jitable
def drive_guarded(
    tick: int, state: DriveState, inputs: Any, numbers: DriveNumbers
) -> None:
    """Decides which speed and yaw rate the robot wants in one tick.

    The function writes ``speed`` and ``turn`` of the memory. It works in these steps:

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
        _stays(m, pose, time)
        _evade(time, pose, 0.0, 0.0, state, numbers)
        return
    wanted, error, there = _find_heading(
        time, target, velocity, pose, state, space, numbers
    )
    # Timer 1: how long the robot has stayed in one place.
    moved = math.hypot(pose[0] - m.stays_at[0], pose[1] - m.stays_at[1])
    if moved > _STAYS_M or there:
        _stays(m, pose, time)
    # Timer 2: how long the guard has blocked the robot. A guard that passes the
    # command, or only slows the robot, does not block the robot.
    if report[0] < TURNED or there or wanted <= 0.0:
        m.blocked_s[0] = time
    # Timer 3: how long all paths have led through occupied cells.
    if time - m.passable_s[0] > _SEARCH_WAY_S and not there:
        m.mode[0], m.blocked_s[0] = GIVING_UP, time
        _stays(m, pose, time)
        _evade(time, pose, 0.0, 0.0, state, numbers)
        return
    if m.mode[0] == WAITING or m.mode[0] == GIVING_UP:
        m.mode[0] = DRIVING
    if m.mode[0] == DRIVING:
        _begin_look(time, pose, pose[2] + error, m, space, numbers)
    if m.mode[0] == LOOKING:
        _look(time, pose, report, state)
    # The robot has stayed in one place for too long. It marks the place in front of it
    # as blocked, backs off, and plans a new path.
    if m.mode[0] == DRIVING and time - m.stays_s[0] > _GIVE_UP_S:
        ahead, at = pose[2] + error, numbers.radius_m + 0.1
        place = pose[0] + at * math.cos(ahead), pose[1] + at * math.sin(ahead)
        mark_blocked(state.way, place, time + _MARK_S)
        m.mode[0], m.backed_s[0], m.planned_s[0] = BACKING, time, -np.inf
    if m.mode[0] == BACKING:
        m.speed[0] = -BACK_SPEED_M_S
        if time - m.backed_s[0] > _BACKING_S:
            m.mode[0], m.blocked_s[0] = DRIVING, time
            _stays(m, pose, time)
    if m.mode[0] == DRIVING:
        _drive(time, velocity, wanted, error, there, state, numbers)
    _evade(time, pose, wanted, error, state, numbers)


@njit(cache=True)
def _remember_held(
    m: DriveMemory, report: Any, time: float
) -> None:  # pragma: no cover  (compiled)
    """Remember the speed that the guard has refused in the last tick."""
    if report[0] >= TURNED and m.speed[0] != 0.0:
        m.held[0], m.held_s[0] = m.speed[0], time
    elif time - m.held_s[0] > _HELD_S:
        m.held[0] = 0.0


@register_jitable
def _evade(time, pose, wanted, error, state, numbers):  # type: ignore[no-untyped-def]
    """Replace speed and turn if a moving body may come near.

    The function first computes the weaving heading from the current turn.
    ``choose_motion`` compares other headings with this heading. A look at a blocked
    place ends when the robot has to evade. The first look around continues.
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


@njit(cache=True)
def _stays(
    m: DriveMemory, pose: Any, time: float
) -> None:  # pragma: no cover  (compiled)
    """Restart the timer that measures how long the robot stays in one place."""
    m.stays_at[0], m.stays_at[1], m.stays_s[0] = pose[0], pose[1], time


@register_jitable
def _find_heading(  # type: ignore[no-untyped-def]
    time, target, velocity, pose, state, space, numbers
):
    """Return wanted speed, m/s, heading error, rad, and whether the robot has arrived.

    The function works in four steps:

    1. Every ``_REPLAN_S`` it plans a new path. Echoes near the target and near tracked
       bodies do not block the path.
    2. It chooses the carrot: the farthest point of the path that a straight drive
       reaches as cheaply (``find_carrot``). The heading error is the angle from the
       robot's heading to the carrot.
    3. It finds the distance that is left. This is the length of the path, or the direct
       distance if the path is almost straight and avoids nothing. In the second case, a
       robot close to the target heads for the target itself.
    4. The wanted speed follows from this distance minus the follow distance, and from
       the speed at which the target moves away (``wanted_speed``).
    """
    m, way, hazards = state.memory, state.way, state.hazards
    x, y, theta = pose[0], pose[1], pose[2]
    if time - m.planned_s[0] >= _REPLAN_S - 0.5 * numbers.tick_s:
        goal = target[0], target[1]
        clear = np.empty((1 + len(hazards.exists), 3))
        clear[0, 0], clear[0, 1], clear[0, 2] = *goal, _SOURCE_CLEARANCE_M
        count = 1 + find_movers(hazards, time, clear[1:])
        find_way(way, space, (x, y), goal, time, numbers.radius_m, clear[:count])
        m.planned_s[0] = time
        if way.dearest[0] < OCCUPIED:
            m.passable_s[0] = time
    carrot = find_carrot(way, x, y, _LOOK_AHEAD_M)
    # Distance from P to the target, and from the axle.
    follow, offset = numbers.follow_distance_m, numbers.control_point_m
    dx = target[0] - x - offset * math.cos(theta)
    dy = target[1] - y - offset * math.sin(theta)
    distance, length = math.hypot(dx, dy), way.length_m[0]
    direct = math.hypot(target[0] - x, target[1] - y)
    left = max(distance, length - offset)
    # A path over cells is longer than the straight line, even without obstacles.
    if way.dearest[0] <= TIGHT and length < _DETOUR * direct:
        left = distance
        if distance < follow + 3.0 * _THERE_M:
            carrot = target[0], target[1]
    bearing = math.atan2(carrot[1] - y, carrot[0] - x)
    # Speed of the target away from the robot.
    along = velocity[0] * math.cos(bearing) + velocity[1] * math.sin(bearing)
    wanted = wanted_speed(left - follow, along)
    rests = math.hypot(velocity[0], velocity[1]) < _RESTS_M_S
    m.carrot[0], m.carrot[1], m.way_left_m[0] = carrot[0], carrot[1], left
    return wanted, wrapped(bearing - theta), rests and abs(left - follow) < _THERE_M


@register_jitable
def _begin_look(time, pose, ahead, m, space, numbers):  # type: ignore[no-untyped-def]
    """Begin a look before the robot first moves, or when the guard blocks it.

    A look turns the sensors to both sides of a direction, by the same angle. The nearer
    side comes first. The direction of the first look is that of the path (``ahead``).

    A later look begins after the guard has blocked the robot for ``_PATIENCE_S``. The
    guard does not say which cell is in its way. The cell that is not free and lies
    nearest to a point just ahead of the axle is taken for it (``_blocking``). The
    direction of the look is that of this cell, as seen from P.
    """
    x, y, half = pose[0], pose[1], _FIRST_LOOK_RAD
    if m.has_looked[0] > 0.5:
        if time - m.blocked_s[0] <= _PATIENCE_S:
            return
        offset, half = numbers.control_point_m, _LOOK_RAD
        block = _blocking(space, x, y, pose[2], numbers.radius_m)
        m.block[0], m.block[1] = block
        px, py = x + offset * math.cos(pose[2]), y + offset * math.sin(pose[2])
        ahead = math.atan2(block[1] - py, block[0] - px)
    left, right = ahead + half, ahead - half
    if abs(wrapped(left - pose[2])) > abs(wrapped(right - pose[2])):
        left, right = right, left
    m.headings[0], m.headings[1] = left, right
    m.looks_done[0], m.mode[0] = 0.0, LOOKING


@register_jitable
def _look(time, pose, report, state):  # type: ignore[no-untyped-def]
    """Turn to both sides of the blocking cell, until there is room.

    The look ends as soon as the guard reports room. If the robot has turned to both
    sides and there is no room, it marks the cell as blocked for ``_MARK_S``. Then it
    plans a new path and drives. The first look around always turns to both sides and
    marks nothing.
    """
    m = state.memory
    first = m.has_looked[0] < 0.5
    heading = m.headings[0] if m.looks_done[0] < 0.5 else m.headings[1]
    to = wrapped(heading - pose[2])
    m.turn[0] = min(max(_LOOK_GAIN * to, -TURN_RATE_RAD_S), TURN_RATE_RAD_S)
    if abs(to) < _LOOKED_RAD:
        m.looks_done[0] += 1.0
    seen = not first and report[1] > _ROOM_M
    if m.looks_done[0] > 1.5 or seen:
        if not first and not seen:
            mark_blocked(state.way, (m.block[0], m.block[1]), time + _MARK_S)
        m.mode[0], m.blocked_s[0], m.planned_s[0] = DRIVING, time, -np.inf
        m.has_looked[0] = 1.0


@njit(cache=True)
def _blocking(
    space: FreeSpace, x: float, y: float, theta: float, radius: float
) -> tuple[float, float]:  # pragma: no cover  (compiled)
    """Return the middle of the non-free cell nearest to a point ahead of the axle.

    The point is 0.1 m ahead. If all cells are free, the function returns this point.
    """
    corners = np.empty((_MOST_CELLS, 2))
    count = edge_cells(space, x, y, radius + 0.3, space.rolled_m[0], corners)
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
    m = state.memory
    if there:
        m.speed[0], m.turn[0] = wanted, 0.5 * TURN_GAIN * error
        return
    weave = 0.0
    if wanted > 0.0:
        width, period = _WEAVE_RAD, _WEAVE_S
        moves = math.hypot(velocity[0], velocity[1]) > _RESTS_M_S
        narrow = state.way.dearest[0] >= NEAR
        recent = time - state.hazards.moved_s[0] < _MOVES_S
        if recent or (moves and not narrow):
            behind = m.way_left_m[0] - numbers.follow_distance_m - _LITTLE_BEHIND_M
            part = min(max(behind / (_FAR_BEHIND_M - _LITTLE_BEHIND_M), 0.0), 1.0)
            width, period = _SEARCH_RAD * (1.0 - _LESS * part), _SEARCH_S
        weave = width * math.sin(math.tau * time / period)
    m.turn[0] = turn_rate(wrapped(error + weave))
    m.speed[0] = slowed_by(error, wanted)
