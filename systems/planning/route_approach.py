"""Computation of the speed and direction with which a robot follows its planned route.

Baselines that plan share this module. It plans on the robot's own map, as move_base and
Nav2 do: the route leads through all space that is not known to be occupied, and a new
route is planned twice per second.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from systems.planning.carrot import find_carrot
from systems.planning.following import FollowNumbers, wanted_speed
from systems.planning.occupied import SOURCE_CLEARANCE_M
from systems.planning.way import FREE, TIGHT, Way, find_way, make_way

#: Time between two plans, s.
_REPLAN_S = 0.5
#: Price of an unknown cell: five times that of a free cell (NavFn of ROS: 253 and 50).
_UNKNOWN = 5 * FREE
#: Largest distance of the local goal, m.
_LOOK_AHEAD_M = 1.5
#: A route is straight if its length is below this multiple of the direct distance. A
#: route over cells is up to 1.08 times as long as a straight line.
_DETOUR = 1.15
# A robot rests at a target that moves slower than ``_RESTS_M_S``, m/s.
# ``_THERE_M``: error of the distance at which the robot comes to rest, m (the goal
#   tolerance of move_base).
# ``_GONE_M``: error of the distance above which it drives again, m.
_RESTS_M_S, _THERE_M, _GONE_M = 0.1, 0.1, 0.25


class RouteNumbers(NamedTuple):
    """Constants of the approach along a route."""

    follow: FollowNumbers
    radius_m: float
    """Radius of the disc for which routes are planned, m."""
    replan_ticks: int


def route_numbers(
    follow: FollowNumbers, radius_m: float, tick_s: float
) -> RouteNumbers:
    """Computes the constants from the disc that has to pass and the control period."""
    return RouteNumbers(follow, radius_m, max(round(_REPLAN_S / tick_s), 1))


class RouteState(NamedTuple):
    """The route of a robot, and whether the robot rests at its end."""

    way: Way
    """Route to the target."""
    rests: NDArray[np.bool_]
    """(1,) whether the robot rests at its follow distance."""


def route_state(cells: int) -> RouteState:
    """Allocates a state without route, for a map of ``cells`` x ``cells`` cells."""
    return RouteState(make_way(cells), np.zeros(1, dtype=np.bool_))


class Approach(NamedTuple):
    """The local goal on the route, and the speed toward it."""

    speed_m_s: float
    """Wanted speed; negative if the target is nearer than the follow distance. A robot
    with the speed 0 has to stop."""
    x: float
    """Position of the local goal, x in the world frame W, m."""
    y: float
    """Position of the local goal, y in W, m."""
    reach_m: float
    """Distance of P from the local goal, or from the place where P rests before the
    target, m."""
    along_m_s: float
    """Speed of the target in the direction of the local goal."""


@register_jitable
def approach_on_route(
    tick: int, inputs: Any, state: RouteState, numbers: RouteNumbers
) -> Approach:
    """Plans a route if it is time, and computes the approach along the route.

    The local goal is the farthest point of the route, up to 1.5 m away, to which a
    straight line costs little more than the route. It is the target itself if the
    straight line to the target is as good as the route. The remaining distance is that
    of the straight line in this case, otherwise that of the route.

    A robot that comes to its follow distance from a target at rest stops. As in
    move_base and Nav2, which latch their goals, it does not correct its position again
    until the target has moved by ``_GONE_M``.

    Args:
        tick: Number of the control period.
        inputs: Values of the input ports: position of the target, m; velocity of the
            target, m/s; whether there is a target; pose of the robot, m and rad; free
            space.
        state: Route and rest, which the function changes in place.
        numbers: Constants of the approach.

    Returns:
        The approach. Without a target, the speed is 0, and the local goal is the point
        P itself.
    """
    target, velocity, valid, pose, space = inputs
    way, follow = state.way, numbers.follow
    x, y, ahead = pose[0], pose[1], follow.control_point_m
    px, py = x + ahead * math.cos(pose[2]), y + ahead * math.sin(pose[2])
    if valid[0] < 0.5:
        return Approach(0.0, px, py, 0.0, 0.0)
    if tick % numbers.replan_ticks == 0 or way.points[0] == 0:
        clear = np.array([[target[0], target[1], SOURCE_CLEARANCE_M]])
        goal = target[0], target[1]
        radii = numbers.radius_m, numbers.radius_m
        find_way(way, space, (x, y), goal, 0.0, radii, clear, _UNKNOWN)
    gx, gy = find_carrot(way, x, y, _LOOK_AHEAD_M)
    straight = math.hypot(target[0] - px, target[1] - py)
    direct, length = math.hypot(target[0] - x, target[1] - y), way.length_m[0]
    reach = math.hypot(gx - px, gy - py)
    left = max(straight, length - ahead) - follow.distance_m
    # The last point of the route is the middle of the target's cell.
    last = way.path[way.points[0] - 1]
    there = math.hypot(gx - target[0], gy - target[1]) < SOURCE_CLEARANCE_M
    there = there and gx == last[0] and gy == last[1]
    is_straight = way.dearest[0] <= TIGHT and length < _DETOUR * direct
    if there or (is_straight and direct < _LOOK_AHEAD_M):
        gx, gy, left = target[0], target[1], straight - follow.distance_m
        reach = max(left, 0.0)
    slow = math.hypot(velocity[0], velocity[1]) < _RESTS_M_S
    state.rests[0] = abs(left) < (_GONE_M if state.rests[0] else _THERE_M) and slow
    if state.rests[0]:
        return Approach(0.0, gx, gy, reach, 0.0)
    bearing = math.atan2(gy - y, gx - x)
    along = velocity[0] * math.cos(bearing) + velocity[1] * math.sin(bearing)
    return Approach(wanted_speed(left, along), gx, gy, reach, along)
