"""Direction and speed with which the robot follows the route to its target."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba.extending import register_jitable

from systems.planning.carrot import find_carrot
from systems.planning.drive_state import DriveNumbers, DriveState
from systems.planning.following import APPROACH_GAIN, wanted_speed
from systems.planning.hazards import find_movers
from systems.planning.passage import APPROACHING, PASSING, RETREATING
from systems.planning.passing import heading_in_passage, plan_passage
from systems.planning.turning import wrapped
from systems.planning.way import OCCUPIED, TIGHT, find_way
from systems.safety.free_space import FreeSpace

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
# ``RESTS_M_S``: limit of the speed of the target, m/s.
_THERE_M, RESTS_M_S = 0.2, 0.1
# The guard may not let the robot come so near to the body of the target. A robot that
# is nearly there then rests where it is.
# ``_NEARLY_M``: limit of the error of the distance from the target, m.
# ``_SETTLE_S``: time for which the robot first tries to come nearer, s.
_NEARLY_M, _SETTLE_S = 0.4, 3.0


@register_jitable
def find_heading(
    time: float,
    target: Any,
    velocity: Any,
    pose: Any,
    state: DriveState,
    space: FreeSpace,
    numbers: DriveNumbers,
) -> tuple[float, float, bool]:
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

    Args:
        time: Current time, s.
        target: Position (x, y) of the target, m.
        velocity: Velocity of the target, m/s.
        pose: Pose (x, y, theta) of the robot, m and rad.
        state: State of the law. The function changes the state in place.
        space: Map of free space.
        numbers: Constants of the law.

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
        if numbers.creep_m_s > 0.0:
            plan_passage(time, pose, state, space, clear[:count], numbers)
        m.planned_s[0] = time
        if way.dearest[0] < OCCUPIED:
            m.passable_s[0] = time
    p = state.passage
    if p.state[0] == PASSING or p.state[0] == RETREATING:
        m.carrot[0], m.carrot[1] = p.middle
        return *heading_in_passage(p, pose, numbers), False
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
    rests = math.hypot(velocity[0], velocity[1]) < RESTS_M_S
    m.carrot[0], m.carrot[1], m.way_left_m[0] = carrot[0], carrot[1], left
    if state.passage.state[0] == APPROACHING:
        px, py = state.passage.approach
        left = math.hypot(px - x, py - y)
        return min(APPROACH_GAIN * left + 0.1, wanted), wrapped(bearing - theta), False
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
