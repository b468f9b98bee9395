"""Checks by positions whether robots with routes can reach their goals."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import combinations

from diagrams.scenario.participants import FollowerParameters
from systems.base.robot import body_radius
from systems.framework.input_error import InputError
from systems.world.plane import control_point


def check_goals(robots: Mapping[str, FollowerParameters], farthest_m: float) -> None:
    """Refuses unreachable goals, and guards that would have no effect.

    Args:
        robots: Robots by the prefix of their fields in messages.
        farthest_m: ``stop.diverged_range_m``, m.

    Raises:
        InputError: A goal is so far from the start that the run counts as diverged; the
            bodies of two robots would overlap at their goals; or a robot with a route
            has a guard.
    """
    routed = {prefix: robot for prefix, robot in robots.items() if robot.route}
    for prefix, robot in routed.items():
        goal = _goal(robot)
        away = math.dist(goal, _start(robot))
        if away > farthest_m:
            raise InputError(
                f"{prefix}route.goal_m",
                f"({goal[0]:g}, {goal[1]:g}) is {away:.3g} m from the start: "
                f"beyond stop.diverged_range_m, {farthest_m:g} m, a run counts "
                "as diverged; raise that range, or move the goal",
            )
        if robot.guard is not None:
            raise InputError(
                f"{prefix}guard",
                "is set, but only the safety filter of its law keeps a robot on "
                "a route off obstacles; leave guard out",
            )
    for (_, first), (prefix, second) in combinations(routed.items(), 2):
        apart = math.dist(_goal(first), _goal(second))
        least = body_radius(first.robot) + body_radius(second.robot)
        if apart < least:
            goal = _goal(second)
            raise InputError(
                f"{prefix}route.goal_m",
                f"({goal[0]:g}, {goal[1]:g}) is {apart:.3g} m from another "
                "robot's goal, too near for both bodies; move one of them by "
                f"{least:.3g} m or more",
            )


def _goal(robot: FollowerParameters) -> tuple[float, float]:
    assert robot.route is not None
    return robot.route.goal_m


def _start(robot: FollowerParameters) -> tuple[float, float]:
    x, y = control_point(robot.start.pose, robot.robot.control_point_m)
    return x, y
