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
    TURN_FIRST_RAD,
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
from systems.safety.braking import BRAKED, TURNED
from systems.safety.free_space import FreeSpace, edge_cells

#: Modes of the robot, see the docstring of the module.
WAITING, DRIVING, LOOKING, BACKING, GIVING_UP = range(5)

#: Distance that routes keep between the body and occupied cells, m.
CLEARANCE_M = 0.02
#: Echoes within this distance from the target count as echoes of the target, m. The
#: robot expects no other body there.
SOURCE_RADIUS_M = 0.35
#: Distance from the target within which echoes do not block routes, m.
_SOURCE_CLEARANCE_M = 0.85
#: Time from one plan to the next, s.
_REPLAN_S = 0.5
#: Greatest distance to the point of the route toward which the robot drives, m.
LOOK_AHEAD_M = 1.5
#: A route is straight if its length is below this multiple of the direct distance.
_DETOUR = 1.15
# The robot has arrived if both of these values are below their limits.
# ``_THERE_M``: limit of the error of the distance from the target, m.
# ``_RESTS_M_S``: limit of the speed of the target, m/s.
_THERE_M, _RESTS_M_S = 0.2, 0.1
# The guard may not let the robot come so near to the body of the target. A robot that
# is nearly there then rests where it is.
# ``_NEARLY_M``: limit of the error of the distance from the target, m.
# ``_SETTLE_S``: time for which the robot first tries to come nearer, s.
_NEARLY_M, _SETTLE_S = 0.4, 3.0

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

#: Time for which the guard blocks the robot before the robot looks around, s.
_PATIENCE_S = 0.3
# A look turns the robot to both sides of a direction.
# ``_FIRST_LOOK_RAD``: angle to each side in the first look, before the robot has moved,
#   rad.
# ``_LOOK_RAD``: angle to each side in a look at a cell that blocks the robot, rad.
_FIRST_LOOK_RAD, _LOOK_RAD = 0.4, 0.6
# ``_LOOKED_RAD``: a heading of a look is done if the heading error is below this angle,
#   rad.
# ``_LOOK_GAIN``: yaw rate per heading error during a look, 1/s.
_LOOKED_RAD, _LOOK_GAIN = 0.1, 4.0
#: A look ends early if the body's disc is farther from non-free space than required.
#: The distance must exceed the required distance by this amount, m.
_ROOM_M = 0.03
#: Largest number of cells among which the robot searches the cell that blocks it.
_MOST_CELLS = 1_000
#: Time for which routes avoid a place that was marked as blocked, s.
_MARK_S = 10.0
# ``_STAYS_M``: the robot stays in one place until it has moved by more than this, m.
# ``_GIVE_UP_S``: if the robot stays in one place for this time, it marks the place
#   ahead as blocked and backs off, s.
_STAYS_M, _GIVE_UP_S = 0.15, 5.5
#: Duration of backing off, s.
_BACKING_S = 2.0
#: If all routes lead through occupied cells, the robot searches for this time, s. After
#: this time, the robot reports that it gives up.
_SEARCH_WAY_S = 20.0

# ``_NEAR_M``: distance within which the robot evades bodies, m.
# ``_WATCHED``: least number of bodies to be watched for which the robot evades.
_NEAR_M, _WATCHED = 3.5, 0.05
#: After the guard has refused a speed, the robot avoids this speed for this time, s.
_HELD_S = 0.4


class DriveMemory(NamedTuple):
    """Memory of the guarded law. Arrays have the shape (1,) unless stated otherwise."""

    speed: NDArray[np.float64]
    """Wanted forward speed, m/s."""
    turn: NDArray[np.float64]
    """Wanted yaw rate, rad/s."""
    mode: NDArray[np.float64]
    """Mode of the robot, ``WAITING`` to ``GIVING_UP``."""
    carrot: NDArray[np.float64]
    """(2,) point (x, y) of the route toward which the robot drives, m."""
    way_left_m: NDArray[np.float64]
    """Remaining length of the route, m."""
    planned_s: NDArray[np.float64]
    """Time of the last plan, s."""
    passable_s: NDArray[np.float64]
    """Time of the last route without occupied cells, s."""
    blocked_s: NDArray[np.float64]
    """Last time at which the guard did not block the robot, s."""
    stays_at: NDArray[np.float64]
    """(2,) position of the robot when it last moved on, m."""
    stays_s: NDArray[np.float64]
    """Time when the robot last moved on, s."""
    settled: NDArray[np.float64]
    """1 if the robot rests nearly at the follow distance, else 0."""
    has_looked: NDArray[np.float64]
    """1 after the first look around, else 0."""
    headings: NDArray[np.float64]
    """(2,) headings of the current look, rad."""
    looks_done: NDArray[np.float64]
    """Number of headings of the current look that are done."""
    looks_held: NDArray[np.float64]
    """Number of headings of the current look to which the guard did not let the robot
    turn.
    """
    block: NDArray[np.float64]
    """(2,) position of the cell that blocks the robot, m."""
    backs: NDArray[np.float64]
    """Direction of backing off: -1 back, or 1 ahead."""
    backed_s: NDArray[np.float64]
    """Start of backing off in this direction, s."""
    held: NDArray[np.float64]
    """Speed that the guard last refused, m/s, or 0."""
    held_s: NDArray[np.float64]
    """Time when the guard last refused a speed, s."""


class DriveState(NamedTuple):
    """State of the guarded law between two ticks."""

    memory: DriveMemory
    way: Way
    hazards: Hazards


class DriveNumbers(NamedTuple):
    """Constants of the guarded law."""

    follow_distance_m: float
    control_point_m: float
    """Distance of P ahead of the axle, m."""
    sensors: HazardSensors
    half_size: tuple[float, float]
    """Half of the body's length and width, m."""
    widths: tuple[float, float]
    """Distances that routes keep from occupied cells, m: half of the width of the body
    plus margins, and the radius of the disc around the body plus the same margins. In
    narrow passages, only the first distance is kept.
    """
    cruise_m_s: float
    """Largest wanted speed, m/s."""
    tick_s: float


def make_drive_state(cells: int, sensors: int) -> DriveState:
    """Makes the state before the first control period.

    The state has no plan, and its memory contains no earlier position of the robot.
    ``cells`` is the number of cells along a side of the map. ``sensors`` is the number
    of range sensors.
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
    # Timer 3: how long all routes have led through occupied cells.
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
    # as blocked, backs off, and plans a new route.
    if m.mode[0] == DRIVING and time - m.stays_s[0] > _GIVE_UP_S:
        ahead, at = pose[2] + error, numbers.widths[1] + 0.1
        place = pose[0] + at * math.cos(ahead), pose[1] + at * math.sin(ahead)
        mark_blocked(state.way, place, time + _MARK_S)
        _begin_backing(m, time)
    if m.mode[0] == BACKING:
        _back(m, time, pose, error, report)
    if m.mode[0] == DRIVING:
        _drive(time, velocity, wanted, error, there, state, numbers)
    _evade(time, pose, wanted, error, state, numbers)


@njit(cache=True)
def _begin_backing(m: DriveMemory, time: float) -> None:  # pragma: no cover  (compiled)
    """Begins to back off. The robot plans a new route."""
    m.mode[0], m.backs[0] = BACKING, -1.0
    m.backed_s[0], m.planned_s[0] = time, -np.inf


@njit(cache=True)
def _back(
    m: DriveMemory, time: float, pose: Any, error: float, report: Any
) -> None:  # pragma: no cover  (compiled)
    """Drives back for ``_BACKING_S``, or ahead if the guard does not let it drive back.

    A robot that can neither turn nor drive back gets room for the turn ahead. With a
    large heading error, it turns as soon as the guard permits the turn.
    """
    since = time - m.backed_s[0]
    if abs(error) > TURN_FIRST_RAD:
        m.turn[0] = turn_rate(error)
    held = report[0] >= BRAKED if m.turn[0] != 0.0 else report[0] >= TURNED
    held = held and since > _PATIENCE_S
    if held and m.backs[0] < 0.0:
        m.backs[0], m.backed_s[0] = 1.0, time
    elif held or since > _BACKING_S:
        m.mode[0], m.blocked_s[0] = DRIVING, time
        _stays(m, pose, time)
    m.speed[0] = m.backs[0] * BACK_SPEED_M_S


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


@njit(cache=True)
def _stays(
    m: DriveMemory, pose: Any, time: float
) -> None:  # pragma: no cover  (compiled)
    """Restarts the timer that measures how long the robot stays in one place."""
    m.stays_at[0], m.stays_at[1], m.stays_s[0] = pose[0], pose[1], time


@register_jitable
def _find_heading(  # type: ignore[no-untyped-def]
    time, target, velocity, pose, state, space, numbers
):
    """Computes the wanted speed, the heading error, and whether the robot has arrived.

    The function works in four steps:

    1. Every ``_REPLAN_S``, plan a new route. Echoes near the target and near tracked
       bodies do not block the route.
    2. Choose the carrot: the farthest point of the route that a straight line reaches
       at little extra cost. The heading error is the angle from the robot's heading to
       the carrot.
    3. Compute the remaining distance, which is normally the length of the route. If the
       route is almost straight and crosses no cells that may be occupied, the straight
       distance counts instead, and a robot close to the target drives directly toward
       it.
    4. Compute the wanted speed from the remaining distance, the follow distance, and
       the speed at which the target moves away. If the robot has arrived at a target
       that P should reach, the heading error is that of the velocity of P.

    Returns:
        Wanted speed, m/s; heading error, rad; and whether the robot has arrived.
    """
    m, way, hazards = state.memory, state.way, state.hazards
    x, y, theta = pose[0], pose[1], pose[2]
    if time - m.planned_s[0] >= _REPLAN_S - 0.5 * numbers.tick_s:
        goal = target[0], target[1]
        clear = np.empty((1 + len(hazards.exists), 3))
        clear[0, 0], clear[0, 1], clear[0, 2] = *goal, _SOURCE_CLEARANCE_M
        count = 1 + find_movers(hazards, time, clear[1:])
        find_way(way, space, (x, y), goal, time, numbers.widths, clear[:count])
        m.planned_s[0] = time
        if way.dearest[0] < OCCUPIED:
            m.passable_s[0] = time
    carrot = find_carrot(way, x, y, LOOK_AHEAD_M)
    # Distance from P to the target, and from the axle.
    follow, offset = numbers.follow_distance_m, numbers.control_point_m
    dx = target[0] - x - offset * math.cos(theta)
    dy = target[1] - y - offset * math.sin(theta)
    distance, length = math.hypot(dx, dy), way.length_m[0]
    direct = math.hypot(target[0] - x, target[1] - y)
    left = max(distance, length - offset)
    # A route over cells is longer than the straight line, even without obstacles.
    straight = way.dearest[0] <= TIGHT and length < _DETOUR * direct
    if straight:
        left = distance
        if distance < follow + 3.0 * _THERE_M:
            carrot = target[0], target[1]
    bearing = math.atan2(carrot[1] - y, carrot[0] - x)
    # Speed of the target away from the robot.
    along = velocity[0] * math.cos(bearing) + velocity[1] * math.sin(bearing)
    wanted = wanted_speed(left - follow, along, numbers.cruise_m_s)
    rests = math.hypot(velocity[0], velocity[1]) < _RESTS_M_S
    m.carrot[0], m.carrot[1], m.way_left_m[0] = carrot[0], carrot[1], left
    there = rests and abs(left - follow) < _THERE_M
    if follow < offset:
        # No body is at the target. Beside it, the bearing from the axle says little.
        if there:
            bearing = math.atan2(dy, dx)
        return wanted, wrapped(bearing - theta), there
    if not (rests and straight and left - follow < _NEARLY_M):
        m.settled[0] = 0.0
    elif time - m.stays_s[0] > _SETTLE_S:
        m.settled[0] = 1.0
    if m.settled[0] > 0.5:
        wanted, there = min(wanted, 0.0), True
    return wanted, wrapped(bearing - theta), there


@register_jitable
def _begin_look(time, pose, ahead, m, space, numbers):  # type: ignore[no-untyped-def]
    """Begins a look before the robot first moves, or when the guard blocks the robot.

    During a look, the robot turns to both sides of a direction, first to the side
    nearer to its heading. The direction of the first look is that of the route
    (``ahead``).

    A later look begins after the guard has blocked the robot for ``_PATIENCE_S``. The
    guard does not report which cell blocks the robot. Therefore the function assumes
    that it is the cell from ``_blocking``, and the look is in the direction of this
    cell.
    """
    x, y, half = pose[0], pose[1], _FIRST_LOOK_RAD
    if m.has_looked[0] > 0.5:
        if time - m.blocked_s[0] <= _PATIENCE_S:
            return
        offset, half = numbers.control_point_m, _LOOK_RAD
        block = _blocking(space, x, y, pose[2], numbers.widths[1])
        m.block[0], m.block[1] = block
        px, py = x + offset * math.cos(pose[2]), y + offset * math.sin(pose[2])
        ahead = math.atan2(block[1] - py, block[0] - px)
    left, right = ahead + half, ahead - half
    if abs(wrapped(left - pose[2])) > abs(wrapped(right - pose[2])):
        left, right = right, left
    m.headings[0], m.headings[1] = left, right
    m.looks_done[0], m.looks_held[0] = 0.0, 0.0
    m.mode[0], m.blocked_s[0] = LOOKING, time


@register_jitable
def _look(time, pose, report, state):  # type: ignore[no-untyped-def]
    """Turns the robot to both sides of the blocking cell until the guard reports room.

    If there is still no room after both sides, routes avoid the cell for ``_MARK_S``.
    If the guard has let the robot turn to neither side, the robot backs off. The first
    look always turns to both sides and marks no cell.
    """
    m = state.memory
    first = m.has_looked[0] < 0.5
    heading = m.headings[0] if m.looks_done[0] < 0.5 else m.headings[1]
    to = wrapped(heading - pose[2])
    m.turn[0] = min(max(_LOOK_GAIN * to, -TURN_RATE_RAD_S), TURN_RATE_RAD_S)
    # In a narrow place, the guard may not let the robot turn so far.
    held = report[0] >= BRAKED and time - m.blocked_s[0] > _PATIENCE_S
    if abs(to) < _LOOKED_RAD or held:
        m.looks_done[0], m.blocked_s[0] = m.looks_done[0] + 1.0, time
        m.looks_held[0] += 1.0 if held else 0.0
    seen = not first and report[1] > _ROOM_M
    if m.looks_done[0] > 1.5 or seen:
        if not first and not seen:
            mark_blocked(state.way, (m.block[0], m.block[1]), time + _MARK_S)
        m.mode[0], m.blocked_s[0], m.planned_s[0] = DRIVING, time, -np.inf
        if not first and not seen and m.looks_held[0] > 1.5:
            _begin_backing(m, time)
        m.has_looked[0] = 1.0


@njit(cache=True)
def _blocking(
    space: FreeSpace, x: float, y: float, theta: float, radius: float
) -> tuple[float, float]:  # pragma: no cover  (compiled)
    """Finds the non-free cell that is nearest to a point 0.1 m ahead of the axle.

    Returns:
        Middle (x, y) of the cell, m, or the point itself if no such cell is near.
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
    """Drives toward the carrot, which is a point of the route (``_find_heading``).

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
