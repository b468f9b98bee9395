"""A target that moves along a route."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable

from systems.base.robot import RobotParameters
from systems.framework.block import Block, Port, Step
from systems.framework.compiling import njit
from systems.framework.signals import TICK_S
from systems.routes.parameters import RouteParameters
from systems.routes.route import ROUTE_SIZE, ROUTE_UNIT
from systems.world.geometry import control_point

#: Indices of the state. ALONG: arc length of the target, m. SPEED: speed of the target,
#: m/s. REACHED: arc length of P, m. FINGERPRINT: first of four numbers that identify
#: the route.
ALONG, SPEED, REACHED, FINGERPRINT = range(4)
#: The block searches the point nearest to P only on a part of the route, because a
#: route may come near to itself. The part begins ``_BEHIND_M``, m, behind both the last
#: nearest point and the target. It ends ``_AHEAD_M``, m, ahead of both.
_BEHIND_M, _AHEAD_M = 1.0, 0.5
#: Largest lead of a waiting target over P along the route, m (our choice).
LEAD_M = 0.5
#: The target has arrived within this distance of the goal, m.
_THERE_M = 1e-6


class TargetNumbers(NamedTuple):
    """Constants of the step of ``PathTarget``."""

    speed_m_s: float
    acceleration_m_s2: float
    waits: bool
    """Whether the target waits for the robot."""
    control_point_m: float
    """Distance of P ahead of the axle, m."""
    tick_s: float


@njit(cache=True)
def route_fingerprint(
    route: Any,
) -> tuple[float, float, float, float]:  # pragma: no cover  (compiled)
    """Computes four numbers that identify a route.

    ``PathTarget`` notices a new route by these numbers: the count of the points, their
    spacing, a weighted sum of their x coordinates, and a weighted sum of their y
    coordinates.
    """
    count, x, y = int(route[0]), 0.0, 0.0
    for k in range(count):
        x += (k + 1.0) * route[2 + 2 * k]
        y += (k + 1.0) * route[3 + 2 * k]
    return route[0], route[1], x, y


@njit(cache=True)
def nearest_on_route(
    route: Any, x: float, y: float, low: float, high: float
) -> float:  # pragma: no cover  (compiled)
    """Finds the point of a route that is nearest to a given position.

    The function searches only the part of the route between two arc lengths.

    Args:
        route: (ROUTE_SIZE,) value of the port ``route``.
        x: x coordinate of the position in the world frame W, m.
        y: y coordinate of the position in W, m.
        low: Arc length at which the searched part begins, m.
        high: Arc length at which the searched part ends, m.

    Returns:
        Arc length of the nearest point, m.
    """
    count, spacing = int(route[0]), route[1]
    last = (count - 1) * spacing
    low, high = min(max(low, 0.0), last), min(max(high, 0.0), last)
    best, found = np.inf, low
    first = min(int(low / spacing), count - 2)
    for k in range(first, count - 1):
        begin = k * spacing
        if begin > high:
            break
        ax, ay = route[2 + 2 * k], route[3 + 2 * k]
        dx, dy = route[4 + 2 * k] - ax, route[5 + 2 * k] - ay
        squared = max(dx * dx + dy * dy, 1e-18)
        part = ((x - ax) * dx + (y - ay) * dy) / squared
        # Limit the projection to the part and to the segment.
        least = max((low - begin) / spacing, 0.0)
        most = min((high - begin) / spacing, 1.0)
        part = min(max(part, least), most)
        off = math.hypot(ax + part * dx - x, ay + part * dy - y)
        if off < best:
            best, found = off, begin + part * spacing
    return found


@njit(cache=True)
def point_on_route(
    route: Any, along: float
) -> tuple[float, float, float, float]:  # pragma: no cover  (compiled)
    """Returns a point of a route, and the direction of the route at this point.

    The function interpolates the route with cubic Hermite polynomials (Catmull and
    Rom), so that the direction is continuous.

    Args:
        route: (ROUTE_SIZE,) value of the port ``route``.
        along: Arc length s of the point, m.

    Returns:
        Position x and y in the world frame W, m, and derivatives dx/ds and dy/ds.
    """
    count, spacing = int(route[0]), route[1]
    along = min(max(along, 0.0), (count - 1) * spacing)
    k = min(int(along / spacing), count - 2)
    t = along / spacing - k
    place, slope = np.empty(2), np.empty(2)
    for axis in range(2):
        at = 2 + axis
        p, q = route[at + 2 * k], route[at + 2 * (k + 1)]
        # Slopes at both ends: central differences, one-sided at the ends of the route.
        m = q - route[at + 2 * (k - 1)] if k > 0 else 2.0 * (q - p)
        n = route[at + 2 * (k + 2)] - p if k < count - 2 else 2.0 * (q - p)
        m, n = 0.5 * m, 0.5 * n
        b, c = 3.0 * (q - p) - 2.0 * m - n, 2.0 * (p - q) + m + n
        place[axis] = p + t * (m + t * (b + t * c))
        slope[axis] = (m + t * (2.0 * b + 3.0 * t * c)) / spacing
    return place[0], place[1], slope[0], slope[1]


@register_jitable
def next_speed(
    speed: float, way: float, top: float, acceleration: float, tick_s: float
) -> float:
    """Returns the largest speed from which the target can still stop in time.

    The result is the speed at the end of the present tick (control period). The speed
    changes linearly during the tick. If no speed lets the target stop in time, the
    target brakes at the largest deceleration.

    Args:
        speed: Present speed, m/s.
        way: Remaining distance to the point of the stop, m. It is negative beyond this
            point.
        top: Largest permitted speed, m/s.
        acceleration: Largest acceleration and deceleration, m/s^2.
        tick_s: Duration of a tick, s.

    Returns:
        Speed at the end of the tick, m/s, at least 0.
    """
    # Solution v' of (v + v') T/2 + v'^2/(2 a) = way.
    root = 0.25 * tick_s * tick_s + (2.0 * way - speed * tick_s) / acceleration
    braked = acceleration * (math.sqrt(max(root, 0.0)) - 0.5 * tick_s)
    change = acceleration * tick_s
    return max(min(speed + change, top, braked), speed - change, 0.0)


@register_jitable
def path_target_step(
    tick: int, state: Any, inputs: Any, outputs: Any, numbers: TargetNumbers
) -> None:
    """Computes the position and velocity of the target in one tick (control period).

    The state contains, in this order:

    - the arc length of the target along the route, m
    - the speed of the target, m/s
    - the arc length of the route's point nearest to the control point P, m
    - four numbers that identify the route (``route_fingerprint``)
    """
    route, (target, progress, valid) = np.asarray(inputs[0]), outputs
    valid[0] = 1.0
    x, y = control_point(inputs[1], numbers.control_point_m)
    if route[0] < 2.0:
        # Without a route the target is at P.
        target[0], target[1] = x, y
        return
    length = (route[0] - 1.0) * route[1]
    # On a new route, the target begins at rest at the point nearest to P.
    known = route_fingerprint(route)
    is_new = False
    for k in range(4):
        is_new = is_new or state[FINGERPRINT + k] != known[k]
        state[FINGERPRINT + k] = known[k]
    if is_new:
        reached = nearest_on_route(route, x, y, 0.0, length)
        state[ALONG], state[SPEED] = reached, 0.0
    else:
        low = min(state[REACHED], state[ALONG]) - _BEHIND_M
        high = max(state[REACHED], state[ALONG]) + _AHEAD_M
        reached = nearest_on_route(route, x, y, low, high)
    along, speed = state[ALONG], state[SPEED]
    px, py, tx, ty = point_on_route(route, along)
    target[0], target[1], target[2], target[3] = px, py, speed * tx, speed * ty
    progress[0], progress[1] = along, reached
    way = length - along
    if numbers.waits:
        # The target may come to rest within a tick. It then moves up to a T^2/8 farther
        # than with uniform braking.
        late = 0.125 * numbers.acceleration_m_s2 * numbers.tick_s**2
        way = min(way, LEAD_M - late - along + reached)
    after = next_speed(
        speed, way, numbers.speed_m_s, numbers.acceleration_m_s2, numbers.tick_s
    )
    along = along + 0.5 * (speed + after) * numbers.tick_s
    if along > length - _THERE_M:
        along, after = length, 0.0
    state[ALONG], state[SPEED], state[REACHED] = along, after, reached


class PathTarget(Block):
    """Moves a target point along a route, from rest at the start to rest at the goal.

    P is the control point of the robot, ahead of its axle. The output ``target_state``
    is the position and velocity of the target in the world frame W. The output
    ``route_progress`` has two arc lengths along the route: that of the target, and that
    of the route's point nearest to P.

    Because a route may come near to itself, the block searches for the nearest point
    only between the previous nearest point and the target.

    The field ``timing`` selects how the target moves:

    - ``timed``: The speed of the target depends only on time. It rises, stays constant,
      and falls, whatever the robot does.
    - ``waiting``: The target brakes so that it leads P by at most ``LEAD_M`` along the
      route. Its lead can be larger only if P moves back.

    When a new route arrives, the target starts again at rest, at the route's point
    nearest to P. ``path_target_step`` describes the discrete state. The outputs depend
    on the state and the present inputs. There is no latency.

    Args:
        parameters: Speed, acceleration and timing of the target.
        robot: Position of P on the robot.
        tick_s: Control period of the robot, s.

    Reference: Eq. 2 of Engelbrecht, Steyn and Djouani (2021) contains the position and
    velocity of the target. The paper does not describe how the target moves in time.
    The option ``waiting`` is ours.
    """

    part = "tracker"
    inputs = (
        Port("route", ROUTE_SIZE, ROUTE_UNIT),
        Port("pose_WB_estimated", 3, "m, m, rad"),
    )
    outputs = (
        Port(
            "target_state",
            4,
            "m, m, m/s, m/s",
            ("target_x", "target_y", "target_vx", "target_vy"),
        ),
        Port("route_progress", 2, "m, m", ("target_along", "robot_along")),
        Port("target_valid", 1, "0 or 1", ("target_valid",)),
    )
    states = (
        "target_along",
        "target_speed",
        "robot_along",
        "route_points",
        "route_spacing",
        "route_moment_x",
        "route_moment_y",
    )

    def __init__(
        self,
        *,
        parameters: RouteParameters = RouteParameters(),
        robot: RobotParameters = RobotParameters(),
        tick_s: float = TICK_S,
    ) -> None:
        super().__init__()
        self.set_name("path_target")
        numbers = TargetNumbers(
            parameters.speed_m_s,
            parameters.acceleration_m_s2,
            parameters.timing == "waiting",
            robot.control_point_m,
            tick_s,
        )
        self.declare(
            Step(path_target_step, numbers, [0.0] * len(self.states)), tick_s=tick_s
        )
