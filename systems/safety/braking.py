"""Whether a command can be obeyed for a tick, and then braked to rest in free space."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from systems.base.lagged_motion import LaggedMotion, advance_pose
from systems.framework.compiling import njit
from systems.safety.free_space import (
    ROLLED,
    FreeSpace,
    cell_is_free,
    edge_cells,
    nearest_cell,
)
from systems.safety.views import IN_PLACE_M, REST_M

#: What was done with a wish.
PASSED, SLOWED, TURNED, BRAKED, HALTED = range(5)
#: Shares of a wish that are tried, from all of it on.
_SHARES = (1.0, 0.8, 0.6, 0.4, 0.2)

#: A robot turns in its place where it is commanded no faster ahead, m/s, and where the
#: lag leaves it no way ahead but ``IN_PLACE_M``.
_IN_PLACE_M_S = 1e-6
#: It withdraws from what is in view where it gets away by this share of its way: more,
#: and it may not go on past what comes from behind.
_WITHDRAWS = 0.2
#: Where a robot is nearer than it should be, it may come so much nearer in a tick, m.
_SLACK_M = 5e-4


class BrakingNumbers(NamedTuple):
    """How the robot moves and brakes, and how far it keeps off."""

    wheel_radius_m: float
    wheel_separation_m: float
    motor_lag_s: float
    """Time constant of the wheels' speeds, s."""
    braking_m_s2: float
    """Of the faster rim's commanded speed."""
    tick_s: float
    parts: int
    """Of a tick, at whose ends places are looked at."""
    part: LaggedMotion
    """Of the wheels in such a part."""
    top_wheel_speed: float
    """rad/s."""
    keep_m: float
    """Distance of the axle from what is not free, m: radius of the body, and margin."""
    least_m: float
    """The same where a robot has come nearer than it should, m."""
    obstacle_speed_m_s: float
    """Largest speed of what is in view, m/s; 0: all rests."""
    slow_turn_rad_s: float
    """A robot that turns no faster, in its place, counts as at rest."""


class Danger(NamedTuple):
    """What a robot has to keep off, at one tick."""

    corners: NDArray[np.float64]
    """(m, 2) of cells that are not free, ``edge_cells``, m."""
    corner_count: int
    """How many of them there are."""
    cell_m: float
    distance_m: float
    """Of the axle from the nearest of them now, m."""
    arcs: NDArray[np.float64]
    """(sensors, points, 2) where each sensor's view ends, m."""
    ages: NDArray[np.float64]
    """(sensors,) for how long that is so, s."""
    view_distance_m: float
    """Of the axle from where the view ends now, m."""


@register_jitable
def rolled_speeds(speeds: Any, commanded: Any, kept: float) -> tuple[float, float]:
    """Wheel speeds after a period in which a command was held.

    Args:
        speeds: Of the left and the right wheel before, rad/s.
        commanded: The same, held.
        kept: Share of the difference that the lag leaves.

    Returns:
        Left and right, rad/s.
    """
    left = commanded[0] + (speeds[0] - commanded[0]) * kept
    right = commanded[1] + (speeds[1] - commanded[1]) * kept
    return left, right


@njit(cache=True)
def roll_on(
    pose: Any, speeds: Any, commanded: Any, numbers: BrakingNumbers
) -> tuple[Any, Any]:  # pragma: no cover  (compiled)
    """Pose and wheel speeds a part of a tick later, of a plant without slip.

    Args:
        pose: (x, y, theta), m and rad.
        speeds: Of the left and the right wheel, rad/s.
        commanded: The same, held.
        numbers: The plant.

    Returns:
        (x, y, theta) and the speeds.
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
    """The command of a tick later when braking: slower, along the same curve.

    Args:
        commanded: Left and right wheel, rad/s.
        numbers: How it brakes.

    Returns:
        Left and right wheel, rad/s.
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
    """Of a place from where the view ends, less what may come nearer until then, m."""
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
    """Whether a command may be obeyed for a tick.

    It may if on the way to rest, braking after that tick, the axle keeps off by
    ``keep_m`` what is not free. Where it is nearer now, it may not come nearer (but for
    ``_SLACK_M``, so that it can drive along an edge), nor below ``least_m``. Where it
    is nearer than that, as where cells beside it are forgotten, the way has to lead
    away, and no point of a cell so near may come nearer.

    Of what is in view the same holds after each time t with ``obstacle_speed_m_s`` t
    more; or the robot withdraws from it.

    Args:
        pose: (x, y, theta) now, m and rad.
        speeds: Of the left and the right wheel now, rad/s.
        commanded: The command, rad/s.
        danger: What to keep off.
        numbers: The robot.

    Returns:
        Whether it may.
    """
    radius, lag = numbers.wheel_radius_m, numbers.motor_lag_s
    now, keep, least = danger.distance_m, numbers.keep_m, numbers.least_m
    near = now < least
    need = now if near else max(min(keep, now - _SLACK_M), least)
    # A robot that turns in its place stays within its disc.
    in_place = (
        _ahead(commanded, radius) < _IN_PLACE_M_S
        and _ahead(speeds, radius) * lag < IN_PLACE_M
    )
    if now <= 0.0 and not in_place:  # nobody knows which way leads out of there
        return False
    turn = abs(commanded[1] - commanded[0]) * radius / numbers.wheel_separation_m
    slow = in_place and turn <= numbers.slow_turn_rad_s
    moving = numbers.obstacle_speed_m_s > 0.0 and not slow
    begin = pose
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
        # Of the axle, or of the disc's rim by the turn.
        moved = max(way, keep * abs(pose[2] - begin[2]))
        if moving and not _keeps_off_moving(
            (x, y), parts * part_s, moved, danger, numbers
        ):
            return False
        fastest = max(abs(speeds[0]), abs(speeds[1])) * radius
        if commanded[0] == 0.0 and commanded[1] == 0.0 and fastest * lag < REST_M:
            return in_place or not near or reached >= now + 0.05 * way
        if parts % numbers.parts == 0:
            commanded = braked(commanded, numbers)


@njit(cache=True)
def _enters(
    begin: Any, pose: Any, danger: Danger, radius: float
) -> bool:  # pragma: no cover  (compiled)
    """Whether a disc has come nearer to a point of a cell that is not free.

    What the disc holds at the begin is free of obstacles, whatever is remembered of it;
    so are points farther from its middle now than then: those on one side of a line. A
    cell is, if its corners are.

    Args:
        begin: (x, y) of its middle at the begin, m.
        pose: The same now.
        danger: Has the cells.
        radius: Of the disc, m.
    """
    x, y, cell = pose[0], pose[1], danger.cell_m
    back_x, back_y = begin[0] - x, begin[1] - y
    line = 0.5 * (back_x * back_x + back_y * back_y)
    for k in range(danger.corner_count):
        u, v = danger.corners[k, 0] - x, danger.corners[k, 1] - y
        du, dv = max(u, 0.0, -u - cell), max(v, 0.0, -v - cell)
        if du * du + dv * dv < radius * radius:
            # The corner that is farthest ahead.
            ahead = back_x * (u + (cell if back_x < 0.0 else 0.0))
            ahead += back_y * (v + (cell if back_y < 0.0 else 0.0))
            if ahead < line - 1e-12:
                return True
    return False


@njit(cache=True)
def _ahead(speeds: Any, wheel_radius_m: float) -> float:  # pragma: no cover  (compiled)
    """Speed of the axle, ahead or back, m/s."""
    return abs(0.5 * (speeds[0] + speeds[1]) * wheel_radius_m)


@njit(cache=True)
def _keeps_off_moving(
    place: Any, ahead_s: float, moved: float, danger: Danger, numbers: BrakingNumbers
) -> bool:  # pragma: no cover  (compiled)
    """Whether nothing in view can come near by then, or the robot withdraws from it."""
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
    """What a robot has to keep off.

    Args:
        space: What it knows.
        time: s.
        pose: (x, y, theta) now, m and rad.
        reach: How far from the axle cells are looked at, m, and for what rolled way
            they have to stay free, m.
        numbers: The robot.

    Returns:
        All that ``can_be_braked`` takes.
    """
    # As many as there are cells in that square.
    corners = np.empty((int(2.0 * reach[0] / space.cell_m + 3.0) ** 2, 2))
    until = space.facts[0, ROLLED] + reach[1]
    x, y = pose[0], pose[1]
    count = edge_cells(space, x, y, reach[0], until, corners)
    distance = nearest_cell(corners, count, space.cell_m, x, y)
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
    """What to command: a wish, as far as it can be braked, or the brake.

    Tried are the wish, less of it along the same curve, its turn while the way ahead is
    braked, a slow turn, and at last braking as it was found possible before.

    Args:
        pose: (x, y, theta) now, m and rad.
        speeds: Of the left and the right wheel now, rad/s.
        wish: Left and right wheel, rad/s.
        commanded: The last command, rad/s.
        danger: What to keep off.
        numbers: The robot.

    Returns:
        What is done, ``PASSED`` to ``BRAKED``, and left and right wheel, rad/s.
    """
    for number in range(len(_SHARES)):
        share = _SHARES[number]
        part = share * wish[0], share * wish[1]
        if can_be_braked(pose, speeds, part, danger, numbers):
            return PASSED if number == 0 else SLOWED, part
    slower = braked(commanded, numbers)
    ahead, turn = 0.5 * (slower[0] + slower[1]), 0.5 * (wish[1] - wish[0])
    # What a wheel cannot do would be less of a turn than was looked at.
    most = numbers.top_wheel_speed - abs(ahead)
    turn = min(max(turn, -most), most)
    part = ahead - turn, ahead + turn
    if can_be_braked(pose, speeds, part, danger, numbers):
        return TURNED, part
    # Slowly enough to count as rest, it may always turn: it could never get away from
    # what stands near by, else.
    slow = numbers.slow_turn_rad_s * numbers.wheel_separation_m
    slow *= 0.5 / numbers.wheel_radius_m
    turn = min(max(turn, -slow), slow)
    part = ahead - turn, ahead + turn
    if can_be_braked(pose, speeds, part, danger, numbers):
        return TURNED, part
    return BRAKED, slower
