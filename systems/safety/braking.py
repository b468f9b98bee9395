"""Check that a robot can obey a command and then brake to rest in free space."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from systems.base.lagged_motion import LaggedMotion, advance_pose
from systems.framework.compiling import njit
from systems.safety.free_space import FreeSpace, cell_is_free, edge_cells
from systems.safety.outline import Outline, enters, frame_at, gaps, least_between
from systems.safety.views import IN_PLACE_M, REST_M

#: Numbers of the actions of the guard.
PASSED, SLOWED, TURNED, BRAKED, HALTED = range(5)
#: Shares of the wanted wheel speeds that are tried, the largest first.
_SHARES = (1.0, 0.8, 0.6, 0.4, 0.2)

#: A robot that turns on the spot counts as at rest if its yaw rate is at most this
#: value, rad/s.
SLOW_TURN_RAD_S = 0.3
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


class BrakingNumbers(NamedTuple):
    """Model of the robot's motion and braking, and distances that the robot keeps."""

    wheel_radius_m: float
    wheel_separation_m: float
    motor_lag_s: float
    """Time constant of the wheels' speeds, s."""
    braking_m_s2: float
    """Deceleration of the commanded speed of the faster rim, m/s^2."""
    tick_s: float
    parts: int
    """Number of parts of a control period. At the end of each part, the guard compares
    the position of the robot with the cells.
    """
    part: LaggedMotion
    """Motion of the wheels in one part."""
    top_wheel_speed: float
    """Top speed of a wheel, rad/s."""
    outline: Outline
    keep_m: float
    """Distance that the outline has to keep from non-free space, m."""
    least_m: float
    """Distance below which the outline may not come nearer to a cell, m."""
    obstacle_speed_m_s: float
    """Largest speed of obstacles in view, m/s. With 0, all obstacles are at rest."""


class Danger(NamedTuple):
    """Non-free cells and ends of sensor views that the robot has to avoid.

    The view of a sensor is the region in which it has seen free floor. The data are
    those of one control period.
    """

    corners: NDArray[np.float64]
    """(m, 2) corners of non-free cells from ``edge_cells``, m."""
    corner_count: int
    """Number of cells in ``corners``."""
    cell_m: float
    distance_m: float
    """Present distance of the lane from the nearest cell in ``corners``, m. It is minus
    infinity if the axle is in a non-free cell.
    """
    arcs: NDArray[np.float64]
    """(sensors, points, 2) points at which the view of each sensor ends, m."""
    ages: NDArray[np.float64]
    """(sensors,) time since the view of each sensor was updated, s."""
    view_distance_m: float
    """Present distance of the axle from the nearest end of a view, m."""


@register_jitable
def rolled_speeds(speeds: Any, commanded: Any, kept: float) -> tuple[float, float]:
    """Computes the wheel speeds at the end of a time with a constant command.

    Args:
        speeds: Speeds of the left and right wheel at the start, rad/s.
        commanded: Commanded speeds of the left and right wheel, rad/s.
        kept: Share of the difference between actual and commanded speed that remains at
            the end, 0 to 1.

    Returns:
        Speeds of the left and right wheel at the end, rad/s.
    """
    left = commanded[0] + (speeds[0] - commanded[0]) * kept
    right = commanded[1] + (speeds[1] - commanded[1]) * kept
    return left, right


@njit(cache=True)
def roll_on(
    pose: Any, speeds: Any, commanded: Any, numbers: BrakingNumbers
) -> tuple[Any, Any]:  # pragma: no cover  (compiled)
    """Computes the pose and the wheel speeds after one part of a control period.

    The wheels roll without slip.

    Args:
        pose: Pose (x, y, theta) at the start, m and rad.
        speeds: Speeds of the left and right wheel at the start, rad/s.
        commanded: Constant commanded speeds of the left and right wheel, rad/s.
        numbers: Model of the robot.

    Returns:
        Pose (x, y, theta) at the end, m and rad, and speeds of the left and right wheel
        at the end, rad/s.
    """
    part = numbers.part
    duration, lagged = part.duration_s, part.lagged_s
    steady_left, steady_right = commanded[0] * duration, commanded[1] * duration
    left = steady_left + (speeds[0] - commanded[0]) * lagged
    right = steady_right + (speeds[1] - commanded[1]) * lagged
    forward = 0.5 * numbers.wheel_radius_m
    turning = numbers.wheel_radius_m / numbers.wheel_separation_m
    moved = advance_pose(
        pose,
        (forward * (left + right), turning * (right - left)),
        (
            forward * (steady_left + steady_right),
            turning * (steady_right - steady_left),
        ),
        part,
    )
    return moved, rolled_speeds(speeds, commanded, part.kept)


@njit(cache=True)
def braked(
    commanded: Any, numbers: BrakingNumbers
) -> tuple[float, float]:  # pragma: no cover  (compiled)
    """Computes the next command of a robot that brakes without leaving its curve.

    Args:
        commanded: Present commanded speeds of the left and right wheel, rad/s.
        numbers: Model of the robot, for the deceleration.

    Returns:
        Next commanded speeds of the left and right wheel, rad/s.
    """
    fastest = max(abs(commanded[0]), abs(commanded[1])) * numbers.wheel_radius_m
    less = numbers.braking_m_s2 * numbers.tick_s
    if fastest <= less:
        return 0.0, 0.0
    share = 1.0 - less / fastest
    return commanded[0] * share, commanded[1] * share


@njit(cache=True)
def _nearest_view(
    danger: Danger, x: float, y: float, ahead_s: float, speed: float
) -> float:  # pragma: no cover  (compiled)
    """Computes the distance from a position to the nearest possible obstacle, m.

    The function assumes that an obstacle was at the end of each sensor's view when the
    sensor took its last reading. From then until ``ahead_s`` from now, the obstacle
    approaches the position at ``speed``.
    """
    nearest = np.inf
    for sensor in range(danger.arcs.shape[0]):
        best = np.inf
        for k in range(danger.arcs.shape[1]):
            dx, dy = danger.arcs[sensor, k, 0] - x, danger.arcs[sensor, k, 1] - y
            best = min(best, dx * dx + dy * dy)
        comes = 0.0
        if speed > 0.0:
            comes = speed * (danger.ages[sensor] + ahead_s)
        nearest = min(nearest, math.sqrt(best) - comes)
    return nearest


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
    needs no such check.

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
    turn = abs(commanded[1] - commanded[0]) * radius / numbers.wheel_separation_m
    slow = in_place and turn <= SLOW_TURN_RAD_S
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
    if _nearest_view(danger, x, y, ahead_s, speed) >= keep:
        return True
    withdrawn = _nearest_view(danger, x, y, 0.0, 0.0) - danger.view_distance_m
    return moved > 0.0 and withdrawn >= _WITHDRAWS * moved


@njit(cache=True)
def danger_of(
    space: FreeSpace, time: float, pose: Any, reach: Any, numbers: BrakingNumbers
) -> Danger:  # pragma: no cover  (compiled)
    """Collects the cells and ends of sensor views that the robot has to avoid.

    Args:
        space: Map of free space.
        time: Current time, s.
        pose: Present pose (x, y, theta), m and rad.
        reach: Two distances, m. The function collects non-free cells within the first
            distance of the axle. A cell is free only if it will still count as free
            after the wheels have rolled the second distance.
        numbers: Model of the robot.

    Returns:
        Cells and ends of views, as input of ``can_be_braked``.
    """
    # The square contains at most this number of cells.
    corners = np.empty((int(2.0 * reach[0] / space.cell_m + 3.0) ** 2, 2))
    until = space.rolled_m[0] + reach[1]
    x, y = pose[0], pose[1]
    count = edge_cells(space, x, y, reach[0], until, corners)
    distance, frame = np.inf, frame_at(pose, space.cell_m)
    for k in range(count):
        now = gaps(corners[k], space.cell_m, frame, numbers.outline)
        distance = min(distance, max(now[0], now[1]))
    i, j = math.floor(x / space.cell_m), math.floor(y / space.cell_m)
    if not cell_is_free(space, i, j, until):
        distance = -np.inf
    ages = time - space.arcs_s[:, 0]
    danger = Danger(corners, count, space.cell_m, distance, space.arcs, ages, np.inf)
    view_distance = np.inf
    if numbers.obstacle_speed_m_s > 0.0:
        view_distance = _nearest_view(danger, x, y, 0.0, 0.0)
    return Danger(
        corners, count, space.cell_m, distance, space.arcs, ages, view_distance
    )


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

    1. the wanted wheel speeds, then smaller shares of them along the same curve
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
