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

from systems.planning.carrot import find_carrot
from systems.planning.following import FollowNumbers, wanted_speed
from systems.planning.occupied import SOURCE_CLEARANCE_M
from systems.planning.way import Way, find_way

#: Time between two plans, s.
_REPLAN_S = 0.5
#: Largest distance of the local goal, m.
_LOOK_AHEAD_M = 1.5


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


class Approach(NamedTuple):
    """The local goal on the route, and the speed toward it."""

    speed_m_s: float
    """Wanted speed; negative if the target is nearer than the follow distance."""
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
    tick: int, inputs: Any, way: Way, numbers: RouteNumbers
) -> Approach:
    """Plans a route if it is time, and computes the approach along the route.

    The local goal is the farthest point of the route, up to 1.5 m away, to which a
    straight line costs little more than the route. It is the target itself if the
    straight line to the target is as good as the route. The remaining distance is that
    of the straight line in this case, otherwise that of the route.

    Args:
        tick: Number of the control period.
        inputs: Values of the input ports: position of the target, m; velocity of the
            target, m/s; whether there is a target; pose of the robot, m and rad; free
            space.
        way: Route, which the function changes in place.
        numbers: Constants of the approach.

    Returns:
        The approach. Without a target, the speed is 0, and the local goal is the point
        P itself.
    """
    target, velocity, valid, pose, space = inputs
    x, y, ahead = pose[0], pose[1], numbers.follow.control_point_m
    px, py = x + ahead * math.cos(pose[2]), y + ahead * math.sin(pose[2])
    if valid[0] < 0.5:
        return Approach(0.0, px, py, 0.0, 0.0)
    if tick % numbers.replan_ticks == 0 or way.points[0] == 0:
        clear = np.array([[target[0], target[1], SOURCE_CLEARANCE_M]])
        goal = target[0], target[1]
        radii = numbers.radius_m, numbers.radius_m
        find_way(way, space, (x, y), goal, 0.0, radii, clear)
    gx, gy = find_carrot(way, x, y, _LOOK_AHEAD_M)
    straight = math.hypot(target[0] - px, target[1] - py)
    left = max(straight, way.length_m[0] - ahead) - numbers.follow.distance_m
    reach = math.hypot(gx - px, gy - py)
    # The last point of the route is the middle of the target's cell.
    last = way.path[way.points[0] - 1]
    near = math.hypot(gx - target[0], gy - target[1]) < SOURCE_CLEARANCE_M
    if near and gx == last[0] and gy == last[1]:
        gx, gy, left = target[0], target[1], straight - numbers.follow.distance_m
        reach = max(left, 0.0)
    bearing = math.atan2(gy - y, gx - x)
    along = velocity[0] * math.cos(bearing) + velocity[1] * math.sin(bearing)
    return Approach(wanted_speed(left, along), gx, gy, reach, along)
