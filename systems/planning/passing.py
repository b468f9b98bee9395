"""Decision when a long body lines up with a passage, and when it has passed it."""

from __future__ import annotations

import math
from typing import Any

from numba.extending import register_jitable

from systems.planning.drive_state import DriveNumbers, DriveState
from systems.planning.passage import (
    APPROACHING,
    OPEN,
    PASSING,
    RETREATING,
    center_axis,
    find_passage,
    front_error,
    lines_up,
    occupied_points,
    place_approach,
    refine_axis,
    sides,
)
from systems.planning.way import find_way
from systems.safety.free_space import FreeSpace

#: Distance from the robot within which occupied cells count, m.
_REACH_M = 8.0
#: An axle within this distance of its place has reached it, m.
_THERE_M = 0.25

#: Distance of the front from the passage at which the robot has backed out, as a multiple
#: of half of the length.
_BACK = 1.5
#: Share of the difference by which a plan moves the axis while the robot passes.
_GAIN = 0.3


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
    if p.state[0] == RETREATING:
        along, _ = front_error(p, pose, half_size[0])
        if along > -p.half_m[0] - _BACK * half_size[0]:
            return
        p.state[0] = OPEN
    if p.state[0] == PASSING:
        along, _ = front_error(p, pose, half_size[0])
        first, second = sides(points, pose[0], pose[1])
        beyond = along - half_size[0] > -p.half_m[0]
        if beyond and first + second >= 2.0 * radius:
            p.state[0] = OPEN
        else:
            if along < -p.half_m[0] - 0.5 * half_size[0]:
                refine_axis(p, points, _GAIN, half_size[1])
            center_axis(p, space, pose, radius, half_size[1])
            state.memory.passable_s[0] = time
            return
    if p.state[0] == OPEN:
        find_passage(p, state.way, points, radius, half_size)
        if p.state[0] == OPEN:
            return
    else:
        refine_axis(p, points, 1.0, half_size[1])
        place_approach(p, points, radius, half_size[0])
    left = math.hypot(p.approach[0] - pose[0], p.approach[1] - pose[1])
    if left < _THERE_M or lines_up(p, pose, half_size):
        p.state[0] = PASSING
        return
    place = p.approach[0], p.approach[1]
    find_way(state.way, space, here, place, time, numbers.widths, clear)
