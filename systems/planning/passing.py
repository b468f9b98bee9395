"""Decision when a long body lines up with a passage, and when it has passed it."""

from __future__ import annotations

import math
from typing import Any

from numba.extending import register_jitable

from systems.planning.drive_state import DriveMemory, DriveNumbers, DriveState
from systems.planning.passage import (
    LEAVING,
    OPEN,
    PASSING,
    RETREATING,
    Passage,
    along_axis,
    front_error,
    lines_up,
)
from systems.planning.passage_axis import center_axis, refine_axis
from systems.planning.passage_search import (
    find_passage,
    occupied_points,
    place_approach,
    sides,
)
from systems.planning.turning import TURN_FIRST_RAD, turn_rate, wrapped
from systems.planning.way import MARK_S, find_way, mark_blocked
from systems.safety.free_space import FreeSpace

#: Distance from the robot within which occupied cells count, m.
_REACH_M = 8.0
#: An axle within this distance of its place has reached it, m.
_THERE_M = 0.25

# A robot backs out at least and at most so far, as a multiple of half of its length.
_BACK, _FARTHEST = 0.3, 4.0
#: Number of times that the robot tries to pass before it looks for another way.
_TRIES = 6
#: Time for which the guard holds the robot before it backs out, s.
_PATIENCE_S = 1.0
#: A passage ends where no wall is opposite of the one nearest to the axle. This is the
#: cosine of the least angle between both.
_BESIDE = -0.9
# A leaving robot turns by a share of its angle to the axis in half of its length. With
# a share of 1, the end of its rear keeps its distance from the wall. The robot also
# turns so that it uses up its room at the wall.
# ``_LEAVE_SHARE``: this share.
# ``_LEAVE_M``: distance in which it would use up its room, m.
# ``_MOST_ROOM_M``: largest room that counts, m.
# ``_LEAVE_RAD``: heading error above which it turns as fast, rad.
_LEAVE_SHARE, _LEAVE_M, _MOST_ROOM_M, _LEAVE_RAD = 1.0, 0.2, 0.1, 0.2
#: Angle to the axis at which it has turned away, rad.
_AWAY_RAD = 0.7
# Near a passage and in it, a map whose axis is farther beside does not count.
# ``_SURE_M``: this distance, m.
# ``_SURE``: distance of the front from the passage from which on this is so, as a
#   multiple of half of the length.
_SURE_M, _SURE = 0.06, 1.2


@register_jitable
def plan_passage(
    time: float,
    pose: Any,
    state: DriveState,
    space: FreeSpace,
    clear: Any,
    numbers: DriveNumbers,
) -> None:
    """Finds the next passage of the route, and plans the route to its approach.

    The arguments are those of ``find_heading``, and the positions and radii that do not
    block routes.
    """
    p, half_size, radius = state.passage, numbers.half_size, numbers.widths[1]
    here = pose[0], pose[1]
    points = occupied_points(space, here, _REACH_M, clear)
    if p.state[0] >= PASSING:
        state.memory.passable_s[0] = time
    if p.state[0] == RETREATING:
        _plan_retreat(time, pose, state, points, numbers)
    elif p.state[0] == PASSING:
        _plan_passing(time, pose, state, points, space, numbers)
    if p.state[0] == LEAVING:
        angle = abs(wrapped(pose[2] - p.axis[0]))
        if angle > _AWAY_RAD or sides(points, pose[0], pose[1])[0] >= radius:
            p.state[0] = OPEN
    if p.state[0] >= PASSING:
        return
    if p.state[0] == OPEN:
        find_passage(p, state.way, points, radius, half_size, numbers.widest_m)
        if p.state[0] == OPEN:
            return
    else:
        p.maps[0] = 0.0
        refine_axis(p, points, radius, half_size[1])
        if p.width_m[0] >= numbers.widest_m:
            p.state[0] = OPEN
            return
        place_approach(p, points, radius, half_size[0])
    left = math.hypot(p.approach[0] - pose[0], p.approach[1] - pose[1])
    if left < _THERE_M or lines_up(p, pose, half_size):
        p.state[0] = PASSING
        return
    place = p.approach[0], p.approach[1]
    find_way(state.way, space, here, place, time, numbers.widths, clear)


@register_jitable
def _plan_passing(
    time: float,
    pose: Any,
    state: DriveState,
    points: Any,
    space: FreeSpace,
    numbers: DriveNumbers,
) -> None:
    """Adapts the axis, and decides whether the robot has passed or has to back out."""
    p, half_size, radius = state.passage, numbers.half_size, numbers.widths[1]
    along, _ = front_error(p, pose, half_size[0])
    if time - state.memory.blocked_s[0] > _PATIENCE_S:
        p.state[0], state.memory.blocked_s[0] = RETREATING, time
        p.failures[0] += 1.0
        p.backed_from[0] = along
        return
    first, second = sides(points, pose[0], pose[1], _BESIDE)
    if along > half_size[0] and first + second >= 2.0 * radius:
        p.state[0] = LEAVING
        return
    if along < -p.half_m[0] - _SURE * half_size[0]:
        refine_axis(p, points, radius, half_size[1])
    elif along < half_size[0]:
        refine_axis(p, points, _SURE_M, half_size[1])
    center_axis(p, space, pose, radius, half_size[1])


@register_jitable
def _plan_retreat(
    time: float, pose: Any, state: DriveState, points: Any, numbers: DriveNumbers
) -> None:
    """Adapts the axis, and decides whether the robot tries again or gives up."""
    p, half_size, radius = state.passage, numbers.half_size, numbers.widths[1]
    back = _BACK
    along, _ = front_error(p, pose, half_size[0])
    entering = along < half_size[0]
    if entering:
        p.maps[0] = 0.0
        refine_axis(p, points, radius, half_size[1])
    # Before the middle, the robot may line up better from farther away.
    last = p.failures[0] >= _TRIES
    if last or (entering and not lines_up(p, pose, half_size)):
        back = _FARTHEST
    held = time - state.memory.blocked_s[0] > _PATIENCE_S
    if not held and along >= p.backed_from[0] - back * half_size[0]:
        return
    p.state[0], state.memory.blocked_s[0] = PASSING, time
    if last:
        place = p.middle[0], p.middle[1]
        mark_blocked(state.way, place, time + MARK_S)
        p.state[0] = OPEN


@register_jitable
def heading_in_passage(
    p: Passage, pose: Any, numbers: DriveNumbers
) -> tuple[float, float]:
    """Computes the wanted speed, m/s, and the heading error, rad, on the axis."""
    if p.state[0] == RETREATING:
        return -numbers.creep_m_s, 0.0
    return numbers.creep_m_s, along_axis(p, pose, numbers.half_size[0])


@register_jitable
def drive_in_passage(
    m: DriveMemory,
    p: Passage,
    theta: float,
    wanted: float,
    error: float,
    room_m: float,
    numbers: DriveNumbers,
) -> None:
    """Computes the twist of a robot that passes, backs out, or leaves.

    No point of the body is faster than ``creep_m_s``. While the robot passes, the
    middle of its front moves in the wanted direction, so that the body comes in line
    behind it. While it leaves, it turns only so fast that no corner of its rear comes
    nearer to the wall.
    """
    half_length, radius = numbers.half_size[0], numbers.widths[1]
    if p.state[0] == LEAVING:
        room = min(max(room_m, 0.0), _MOST_ROOM_M) / _LEAVE_M
        rate = (_LEAVE_SHARE * abs(wrapped(theta - p.axis[0])) + room) / half_length
        rate *= min(max(error / _LEAVE_RAD, -1.0), 1.0)
        speed = numbers.creep_m_s / (1.0 + abs(rate) * radius)
        m.speed[0], m.turn[0] = speed, speed * rate
        return
    if abs(error) > TURN_FIRST_RAD:
        m.speed[0], m.turn[0] = 0.0, turn_rate(error)
        return
    ahead, rate = math.cos(error), math.sin(error) / half_length
    speed = math.copysign(numbers.creep_m_s, wanted) / (ahead + abs(rate) * radius)
    m.speed[0], m.turn[0] = speed * ahead, speed * rate
