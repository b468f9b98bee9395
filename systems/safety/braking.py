"""Check that a robot can obey a command and then brake to rest in free space."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba.extending import register_jitable

from systems.framework.compiling import njit
from systems.safety.danger import Danger, nearest_view
from systems.safety.outline import enters, frame_at, gaps, is_long, least_between
from systems.safety.predicted_motion import BrakingNumbers, braked, roll_on
from systems.safety.views import IN_PLACE_M, REST_M

#: Numbers of the actions of the guard.
PASSED, SLOWED, TURNED, BRAKED, HALTED = range(5)
#: Shares of the wanted wheel speeds that are tried, the largest first.
_SHARES = (1.0, 0.8, 0.6, 0.4, 0.2)

#: A robot that turns on the spot counts as at rest if its yaw rate is at most this
#: value, rad/s.
SLOW_TURN_RAD_S = 0.3
#: A long body counts as at rest if no point of its disc is faster, m/s (our choice).
CREEP_M_S = 0.3
#: Share of this speed to which a faster command is reduced.
_ALMOST = 0.99
#: A robot turns on the spot if two conditions hold. The commanded speed of the axle is
#: below this number, m/s. The distance that the axle still moves due to the lag of the
#: motors is below ``IN_PLACE_M``.
_IN_PLACE_M_S = 1e-6
#: Least share of the robot's motion that leads away from obstacles in view while the
#: robot withdraws. With a larger share, the robot could not drive on if an obstacle
#: approached from behind.
_WITHDRAWS = 0.2
#: Tolerance for a robot that is nearer than ``keep_m`` and may not come nearer, m.
_SAME_M = 1e-6


@njit(cache=True)
def can_be_braked(
    pose: Any, speeds: Any, commanded: Any, danger: Danger, numbers: BrakingNumbers
) -> bool:  # pragma: no cover  (compiled)
    """Checks whether the robot may obey a command for one control period.

    The function predicts that the robot obeys the command for one period and then
    brakes to rest. After each part of a period, it computes the distance of the body
    from the non-free cells. If the robot turns on the spot, the distance is that of the
    outline. Otherwise, it is that of the lane: a robot that drives keeps room in front
    and behind in which it can turn. For each cell, the limit of this distance depends
    on the present distance:

    - Present distance of at least ``keep_m``: the limit is ``keep_m``.
    - Smaller present distance, but at least ``least_m``: the robot must not come nearer
      to the cell.
    - Present distance below ``least_m``: no point of the cell that is within
      ``least_m`` may come nearer.

    Between two parts, the distance from the first two kinds of cells stays at least
    ``least_m``.

    If obstacles may move, the function also assumes obstacles at the ends of the sensor
    views. From the time of the reading on, these obstacles move at
    ``obstacle_speed_m_s``. Then the disc around the axle that contains the body must
    stay ``keep_m`` away from all points that these obstacles may reach, or the robot
    must withdraw from the end of the view. A slow turn on the spot counts as rest and
    needs no such check, and so does a long body that creeps (``CREEP_M_S``).

    Args:
        pose: Present pose (x, y, theta), m and rad.
        speeds: Present speeds of the left and right wheel, rad/s.
        commanded: Commanded speeds of the left and right wheel, rad/s.
        danger: Cells and ends of views to avoid.
        numbers: Model of the robot.

    Returns:
        True if the robot may obey the command.
    """
    radius, lag = numbers.wheel_radius_m, numbers.motor_lag_s
    outline, cell = numbers.outline, danger.cell_m
    in_place = (
        _ahead(commanded, radius) < _IN_PLACE_M_S
        and _ahead(speeds, radius) * lag < IN_PLACE_M
    )
    # From a cell that is not free, the way out is unknown.
    if danger.distance_m == -np.inf and not in_place:
        return False
    slow = _counts_as_rest(speeds, commanded, in_place, numbers)
    moving = numbers.obstacle_speed_m_s > 0.0 and not slow
    begin, disc = pose, outline.radius_m + numbers.keep_m
    # Number of distances from ``gaps`` that separate a cell from the body.
    separating = 3 if in_place else 2
    frame = frame_at(pose, cell)
    cells, distances, sides = _watched(
        frame, speeds, commanded, separating, danger, numbers
    )
    # Predict until the wheels are at rest, and brake after the first tick.
    part_s = numbers.tick_s / numbers.parts
    parts = 0
    while True:
        before, was = speeds, frame
        pose, speeds = roll_on(pose, speeds, commanded, numbers)
        parts += 1
        frame = frame_at(pose, cell)
        dip = _dip(before, speeds, commanded, part_s, numbers)
        for k in range(len(cells)):
            corner = danger.corners[cells[k]]
            if distances[k] < numbers.least_m:
                if _comes_nearer(
                    corner, (was, frame), (before, speeds), separating, cell, numbers
                ):
                    return False
                continue
            now = gaps(corner, cell, frame, outline)
            nearest = max(now[0], now[1])
            if in_place:
                nearest = max(nearest, now[2])
            if nearest < min(numbers.keep_m, distances[k] - _SAME_M):
                return False
            # The same side separates the cell from the body between the two parts.
            between = -np.inf
            for side in range(separating):
                least = least_between(sides[k, side], now[side], dip)
                between = max(between, least)
                sides[k, side] = now[side]
            if between < numbers.least_m:
                return False
        # Distance that the axle moves, or distance that the disc's rim moves in the
        # turn, whichever is longer.
        way = math.hypot(pose[0] - begin[0], pose[1] - begin[1])
        moved = max(way, disc * abs(pose[2] - begin[2]))
        if moving and not _keeps_off_moving(
            (pose[0], pose[1]), parts * part_s, moved, danger, numbers
        ):
            return False
        # At rest: the check is complete.
        fastest = max(abs(speeds[0]), abs(speeds[1])) * radius
        if commanded[0] == 0.0 and commanded[1] == 0.0 and fastest * lag < REST_M:
            return True
        if parts % numbers.parts == 0:
            commanded = braked(commanded, numbers)


@register_jitable
def _counts_as_rest(
    speeds: Any, commanded: Any, in_place: Any, numbers: BrakingNumbers
) -> bool:
    """Checks whether the robot is so slow that moving obstacles do not matter."""
    turn = abs(commanded[1] - commanded[0]) * numbers.wheel_radius_m
    if in_place and turn / numbers.wheel_separation_m <= SLOW_TURN_RAD_S:
        return True
    fastest = max(_fastest_point(commanded, numbers), _fastest_point(speeds, numbers))
    return is_long(numbers.outline) and fastest <= CREEP_M_S


@njit(cache=True)
def _fastest_point(
    wheels: Any, numbers: BrakingNumbers
) -> float:  # pragma: no cover  (compiled)
    """Computes the speed of the fastest point of the disc, m/s.

    ``wheels`` are the speeds of the left and right wheel, rad/s.
    """
    radius, lever = numbers.wheel_radius_m, numbers.outline.radius_m
    turn = abs(wheels[1] - wheels[0]) * radius / numbers.wheel_separation_m
    return _ahead(wheels, radius) + turn * lever


@njit(cache=True)
def _watched(
    frame: Any,
    speeds: Any,
    commanded: Any,
    separating: int,
    danger: Danger,
    numbers: BrakingNumbers,
) -> tuple[Any, Any, Any]:  # pragma: no cover  (compiled)
    """Selects the cells that the body could come near while it obeys and brakes.

    ``separating`` is the number of distances from ``gaps`` that count: 3 for the
    outline and 2 for the lane.

    Returns:
        Indices of the cells, their present distances from the outline or the lane, m,
        and the three distances of each cell from ``gaps``.
    """
    radius, lag = numbers.wheel_radius_m, numbers.motor_lag_s
    ahead = max(_ahead(commanded, radius), _ahead(speeds, radius))
    fastest = 0.0
    for k in range(2):
        fastest = max(fastest, abs(commanded[k]) * radius, abs(speeds[k]) * radius)
    delayed = lag + 2.0 * numbers.tick_s
    way = ahead * (0.5 * fastest / numbers.braking_m_s2 + delayed)
    reach = way + numbers.outline.radius_m + numbers.keep_m
    count, cell = danger.corner_count, danger.cell_m
    cells = np.empty(count, dtype=np.int64)
    distances, sides, found = np.empty(count), np.empty((count, 3)), 0
    for k in range(count):
        corner = danger.corners[k]
        dx = max(corner[0] - frame.x, 0.0, frame.x - corner[0] - cell)
        dy = max(corner[1] - frame.y, 0.0, frame.y - corner[1] - cell)
        if dx * dx + dy * dy < reach * reach:
            now = gaps(corner, cell, frame, numbers.outline)
            for side in range(3):
                sides[found, side] = now[side]
            nearest = max(now[0], now[1])
            distances[found] = max(nearest, now[2]) if separating > 2 else nearest
            cells[found] = k
            found += 1
    return cells[:found], distances[:found], sides


@njit(cache=True)
def _dip(
    before: Any, after: Any, commanded: Any, part_s: float, numbers: BrakingNumbers
) -> float:  # pragma: no cover  (compiled)
    """Computes how far a distance can dip below its values at both ends of a part, m.

    A distance from ``gaps`` changes with a second derivative of at most the
    acceleration of the outline's points. The accelerations of the wheels decrease
    during the part, and their speeds lie between those at both ends.
    """
    radius, separation = numbers.wheel_radius_m, numbers.wheel_separation_m
    lever = numbers.outline.radius_m + numbers.keep_m
    left = (commanded[0] - before[0]) * radius / numbers.motor_lag_s
    right = (commanded[1] - before[1]) * radius / numbers.motor_lag_s
    pushes = 0.5 * abs(left + right) + lever * abs(right - left) / separation
    ahead = max(_ahead(before, radius), _ahead(after, radius))
    turn = max(abs(before[1] - before[0]), abs(after[1] - after[0]))
    speed = ahead + lever * turn * radius / separation
    pulls = speed * speed / numbers.outline.radius_m
    return 0.125 * part_s * part_s * (pushes + pulls)


@njit(cache=True)
def _comes_nearer(
    corner: Any,
    frames: Any,
    speeds: Any,
    separating: int,
    cell_m: float,
    numbers: BrakingNumbers,
) -> bool:  # pragma: no cover  (compiled)
    """Checks whether a point of a cell may enter the body in a part of a period.

    ``frames`` and ``speeds`` are those at the start and at the end of the part. If the
    lane counts, all cells in the lane are near.
    """
    radius, separation = numbers.wheel_radius_m, numbers.wheel_separation_m
    outline, margin = numbers.outline, numbers.least_m
    ahead = outline.half_length_m if separating > 2 else outline.radius_m
    near = ahead + margin, outline.half_width_m + margin
    for wheels in speeds:
        twist = (
            0.5 * (wheels[0] + wheels[1]) * radius,
            (wheels[1] - wheels[0]) * radius / separation,
        )
        for frame in frames:
            if enters(corner, cell_m, frame, twist, outline, near):
                return True
    return False


@njit(cache=True)
def _ahead(speeds: Any, wheel_radius_m: float) -> float:  # pragma: no cover  (compiled)
    """Return the absolute speed of the axle, m/s."""
    return abs(0.5 * (speeds[0] + speeds[1]) * wheel_radius_m)


@njit(cache=True)
def _keeps_off_moving(
    place: Any, ahead_s: float, moved: float, danger: Danger, numbers: BrakingNumbers
) -> bool:  # pragma: no cover  (compiled)
    """Returns whether the robot keeps away from obstacles that it cannot see.

    Such an obstacle may be just behind the end of a sensor's view, and may come toward
    the robot. The result is true if no such obstacle can be within ``keep_m`` of the
    disc around ``place`` at the time ``ahead_s`` from now. The result is also true if
    the robot moves away from the nearest end of a view.
    """
    x, y = place
    speed = numbers.obstacle_speed_m_s
    keep = numbers.outline.radius_m + numbers.keep_m
    if nearest_view(danger, x, y, ahead_s, speed) >= keep:
        return True
    withdrawn = nearest_view(danger, x, y, 0.0, 0.0) - danger.view_distance_m
    return moved > 0.0 and withdrawn >= _WITHDRAWS * moved


@njit(cache=True)
def chosen(
    pose: Any,
    speeds: Any,
    wish: Any,
    commanded: Any,
    danger: Danger,
    numbers: BrakingNumbers,
) -> tuple[int, tuple[float, float]]:  # pragma: no cover  (compiled)
    """Chooses a command from which the robot can brake to rest.

    The function returns the first of these commands that ``can_be_braked`` permits:

    1. the wanted wheel speeds, then smaller shares of them along the same curve; with
       moving obstacles and a long body, also the share with which it creeps
    2. the wanted turn, while the forward motion brakes
    3. the same turn, but slow enough to count as rest
    4. the wanted forward motion without the turn
    5. braking along the present curve, without a check, because the previous control
       period has already checked it

    Args:
        pose: Present pose (x, y, theta), m and rad.
        speeds: Present speeds of the left and right wheel, rad/s.
        wish: Wanted speeds of the left and right wheel, rad/s.
        commanded: Last command for the left and right wheel, rad/s.
        danger: Cells and ends of views to avoid.
        numbers: Model of the robot.

    Returns:
        Action (a number from ``PASSED`` to ``BRAKED``), and commanded speeds of the
        left and right wheel, rad/s.
    """
    for number in range(len(_SHARES)):
        share = _SHARES[number]
        part = share * wish[0], share * wish[1]
        if can_be_braked(pose, speeds, part, danger, numbers):
            return PASSED if number == 0 else SLOWED, part
    fastest = _fastest_point(wish, numbers)
    moving = numbers.obstacle_speed_m_s > 0.0
    if moving and fastest > CREEP_M_S and is_long(numbers.outline):
        share = _ALMOST * CREEP_M_S / fastest
        part = share * wish[0], share * wish[1]
        if can_be_braked(pose, speeds, part, danger, numbers):
            return SLOWED, part
    slower = braked(commanded, numbers)
    ahead, turn = 0.5 * (slower[0] + slower[1]), 0.5 * (wish[1] - wish[0])
    # Limit the turn to the top speed of the wheels. Otherwise the robot would turn less
    # than predicted.
    most = numbers.top_wheel_speed - abs(ahead)
    turn = min(max(turn, -most), most)
    part = ahead - turn, ahead + turn
    if can_be_braked(pose, speeds, part, danger, numbers):
        return TURNED, part
    # On the spot, a turn that is slow enough to count as rest needs no distance from
    # moving obstacles. Otherwise the robot could never get away from one that is near.
    slow = SLOW_TURN_RAD_S * numbers.wheel_separation_m
    slow *= 0.5 / numbers.wheel_radius_m
    turn = min(max(turn, -slow), slow)
    part = ahead - turn, ahead + turn
    if can_be_braked(pose, speeds, part, danger, numbers):
        return TURNED, part
    # In a narrow passage, the robot can drive on but cannot turn.
    ahead = 0.5 * (wish[0] + wish[1])
    if abs(ahead) * numbers.wheel_radius_m > _IN_PLACE_M_S:
        for number in range(len(_SHARES)):
            part = _SHARES[number] * ahead, _SHARES[number] * ahead
            if can_be_braked(pose, speeds, part, danger, numbers):
                return SLOWED, part
    return BRAKED, slower
