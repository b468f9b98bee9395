"""Looks to both sides, before the first motion or at a cell that blocks the robot."""

from __future__ import annotations

import math

import numpy as np
from numba.extending import register_jitable

from systems.framework.compiling import njit
from systems.planning.back_off import PATIENCE_S, begin_backing
from systems.planning.drive_state import DRIVING, LOOKING
from systems.planning.turning import TURN_RATE_RAD_S, wrapped
from systems.planning.way import MARK_S, mark_blocked
from systems.safety.braking import BRAKED
from systems.safety.free_space import FreeSpace, edge_cells

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


@register_jitable
def begin_look(time, pose, ahead, m, space, numbers):  # type: ignore[no-untyped-def]
    """Begins a look before the robot first moves, or when the guard blocks the robot.

    During a look, the robot turns to both sides of a direction, first to the side
    nearer to its heading. The direction of the first look is that of the route
    (``ahead``).

    A later look begins after the guard has blocked the robot for ``PATIENCE_S``. The
    guard does not report which cell blocks the robot. Therefore the function assumes
    that it is the cell from ``_blocking``, and the look is in the direction of this
    cell.
    """
    x, y, half = pose[0], pose[1], _FIRST_LOOK_RAD
    if m.has_looked[0] > 0.5:
        if time - m.blocked_s[0] <= PATIENCE_S:
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
def look_around(time, pose, report, state):  # type: ignore[no-untyped-def]
    """Turns the robot to both sides of the blocking cell until the guard reports room.

    If there is still no room after both sides, routes avoid the cell for ``MARK_S``.
    If the guard has let the robot turn to neither side, the robot backs off. The first
    look always turns to both sides and marks no cell.
    """
    m = state.memory
    first = m.has_looked[0] < 0.5
    heading = m.headings[0] if m.looks_done[0] < 0.5 else m.headings[1]
    to = wrapped(heading - pose[2])
    m.turn[0] = min(max(_LOOK_GAIN * to, -TURN_RATE_RAD_S), TURN_RATE_RAD_S)
    # In a narrow place, the guard may not let the robot turn so far.
    held = report[0] >= BRAKED and time - m.blocked_s[0] > PATIENCE_S
    if abs(to) < _LOOKED_RAD or held:
        m.looks_done[0], m.blocked_s[0] = m.looks_done[0] + 1.0, time
        m.looks_held[0] += 1.0 if held else 0.0
    seen = not first and report[1] > _ROOM_M
    if m.looks_done[0] > 1.5 or seen:
        if not first and not seen:
            mark_blocked(state.way, (m.block[0], m.block[1]), time + MARK_S)
        m.mode[0], m.blocked_s[0], m.planned_s[0] = DRIVING, time, -np.inf
        if not first and not seen and m.looks_held[0] > 1.5:
            begin_backing(m, time)
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
