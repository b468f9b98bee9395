"""Check that a robot can obey a command and then brake to rest in free space."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from systems.base.lagged_motion import LaggedMotion, advance_pose
from systems.framework.compiling import njit
from systems.safety.free_space import (
    FreeSpace,
    cell_is_free,
    edge_cells,
    nearest_cell,
)
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
#: A robot between ``least_m`` and ``keep_m`` from non-free space may come nearer to
#: this space by this distance per tick, m. The robot can then drive along the edge of
#: the free space.
_SLACK_M = 5e-4


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
    keep_m: float
    """Distance that the axle has to keep from non-free space, m: the radius of the body
    plus the margins.
    """
    least_m: float
    """Smaller distance, m, that applies to a robot nearer than ``keep_m``."""
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
    """Present distance of the axle from the nearest cell in ``corners``, m."""
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
    brakes to rest. After each part of a period, it computes the distance of the axle
    from the non-free cells. The limit of this distance depends on the present distance:

    - Present distance of at least ``keep_m`` plus ``_SLACK_M``: the limit is
      ``keep_m``.
    - Smaller present distance, but at least ``least_m``: the axle may come nearer by
      ``_SLACK_M``, but not nearer than ``least_m``.
    - Present distance below ``least_m``, because the map has forgotten nearby cells:
      the axle must not come nearer to any point of a cell within ``least_m``, and must
      end farther away.

    These limits do not apply to a turn on the spot, because it does not move the disc
    that contains the body.

    If obstacles may move, the function also assumes obstacles at the ends of the sensor
    views. From the time of the reading on, these obstacles move at
    ``obstacle_speed_m_s``. Then the axle must stay ``keep_m`` away from all points that
    these obstacles may reach, or the robot must withdraw from the end of the view. A
    slow turn on the spot counts as rest and needs no such check.

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
    now, keep, least = danger.distance_m, numbers.keep_m, numbers.least_m
    near = now < least
    need = now if near else max(min(keep, now - _SLACK_M), least)
    # A robot that turns on the spot stays within its disc.
    in_place = (
        _ahead(commanded, radius) < _IN_PLACE_M_S
        and _ahead(speeds, radius) * lag < IN_PLACE_M
    )
    if now <= 0.0 and not in_place:  # the way out is unknown
        return False
    turn = abs(commanded[1] - commanded[0]) * radius / numbers.wheel_separation_m
    slow = in_place and turn <= SLOW_TURN_RAD_S
    moving = numbers.obstacle_speed_m_s > 0.0 and not slow
    begin = pose
    # Predict until the wheels are at rest, and brake after the first tick.
    part_s = numbers.tick_s / numbers.parts
    parts = 0
    while True:
        pose, speeds = roll_on(pose, speeds, commanded, numbers)
        parts += 1
        x, y = pose[0], pose[1]
        way = math.hypot(x - begin[0], y - begin[1])
        reached = nearest_cell(danger.corners, danger.corner_count, danger.cell_m, x, y)
        if not in_place and (
            reached < need or (near and _enters(begin, pose, danger, least))
        ):
            return False
        # Distance that the axle moves, or distance that the disc's rim moves in the
        # turn, whichever is longer.
        moved = max(way, keep * abs(pose[2] - begin[2]))
        if moving and not _keeps_off_moving(
            (x, y), parts * part_s, moved, danger, numbers
        ):
            return False
        # At rest: the check is complete. A motion that began too near has to end
        # farther away.
        fastest = max(abs(speeds[0]), abs(speeds[1])) * radius
        if commanded[0] == 0.0 and commanded[1] == 0.0 and fastest * lag < REST_M:
            return in_place or not near or reached >= now + 0.05 * way
        if parts % numbers.parts == 0:
            commanded = braked(commanded, numbers)


@njit(cache=True)
def _enters(
    begin: Any, pose: Any, danger: Danger, radius: float
) -> bool:  # pragma: no cover  (compiled)
    """Checks whether a point of a non-free cell may have entered the robot's disc.

    The robot's disc at the start of the motion contains no obstacle, whatever the map
    states. A point of the present disc was already in that disc if it is nearer to the
    center at the start than to the present center. The function ignores cells that
    contain only such points.
    """
    x, y, cell = pose[0], pose[1], danger.cell_m
    back_x, back_y = begin[0] - x, begin[1] - y
    line = 0.5 * (back_x * back_x + back_y * back_y)
    for k in range(danger.corner_count):
        u, v = danger.corners[k, 0] - x, danger.corners[k, 1] - y
        du, dv = max(u, 0.0, -u - cell), max(v, 0.0, -v - cell)
        if du * du + dv * dv < radius * radius:
            # Check the corner that is farthest from the start, along the motion.
            ahead = back_x * (u + (cell if back_x < 0.0 else 0.0))
            ahead += back_y * (v + (cell if back_y < 0.0 else 0.0))
            if ahead < line - 1e-12:
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
    the robot. The result is true if no such obstacle can be within ``keep_m`` of
    ``place`` at the time ``ahead_s`` from now. The result is also true if the robot
    moves away from the nearest end of a view.
    """
    x, y = place
    speed = numbers.obstacle_speed_m_s
    if _nearest_view(danger, x, y, ahead_s, speed) >= numbers.keep_m:
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
    distance = nearest_cell(corners, count, space.cell_m, x, y)
    # If the axle is in a cell that is not free, the distance is 0.
    i, j = math.floor(x / space.cell_m), math.floor(y / space.cell_m)
    if not cell_is_free(space, i, j, until):
        distance = 0.0
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
    4. braking along the present curve, without a check, because the previous control
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
    # On the spot, a turn that is slow enough to count as rest is always permitted.
    # Otherwise the robot could never get away from a nearby obstacle.
    slow = SLOW_TURN_RAD_S * numbers.wheel_separation_m
    slow *= 0.5 / numbers.wheel_radius_m
    turn = min(max(turn, -slow), slow)
    part = ahead - turn, ahead + turn
    if can_be_braked(pose, speeds, part, danger, numbers):
        return TURNED, part
    return BRAKED, slower
