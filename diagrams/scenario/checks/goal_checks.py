"""Checks by positions whether robots with routes can reach their goals."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from itertools import combinations

from diagrams.scenario.bodies import Body
from diagrams.scenario.map_parameters import MapParameters
from diagrams.scenario.participants import Robot, Router
from diagrams.scenario.run_parameters import StopParameters
from systems.base.robot import body_radius
from systems.framework.input_error import InputError
from systems.world.parameters import ObstacleParameters
from systems.world.plane import control_point


def check_goals(robots: Mapping[str, Robot], stop: StopParameters) -> None:
    """Raises an error if a robot with a route cannot reach its goal.

    Args:
        robots: Robots of the scenario, by name.
        stop: Conditions that end a run.

    Raises:
        InputError: A robot starts so far from its goal that the run counts as diverged.
        InputError: The bodies of two robots would overlap at their goals.
    """
    routed = {
        name: robot for name, robot in robots.items() if isinstance(robot, Router)
    }
    for name, robot in routed.items():
        goal = robot.route.goal_m
        away = math.dist(goal, _start(robot))
        farthest_m = stop.diverged_range_m
        if farthest_m is not None and away > farthest_m:
            raise InputError(
                f"robots.{name}.route.goal_m",
                f"({goal[0]:g}, {goal[1]:g}) is {away:.3g} m from the start: "
                f"beyond stop.diverged_range_m, {farthest_m:g} m, a run counts "
                "as diverged; set that range to null, or move the goal",
            )
    for (_, first), (name, second) in combinations(routed.items(), 2):
        apart = math.dist(first.route.goal_m, second.route.goal_m)
        least = body_radius(first.robot) + body_radius(second.robot)
        if apart < least:
            goal = second.route.goal_m
            raise InputError(
                f"robots.{name}.route.goal_m",
                f"({goal[0]:g}, {goal[1]:g}) is {apart:.3g} m from another "
                "robot's goal, too near for both bodies; move one of them by "
                f"{least:.3g} m or more",
            )


def check_filled_goals(
    robots: Mapping[str, Robot], obstacles: Iterable[ObstacleParameters | MapParameters]
) -> None:
    """Raises an error if the goal of a route is inside a polygon.

    The planner of routes knows only the edges of polygons.

    Args:
        robots: Robots of the scenario, by name.
        obstacles: Obstacles of the scenario, and its map.

    Raises:
        InputError: A goal is inside a known obstacle at rest with ``polygon_m``.
    """
    for name, robot in robots.items():
        if not isinstance(robot, Router):
            continue
        goal = robot.route.goal_m
        for obstacle in obstacles:
            at_rest = obstacle.known and not obstacle.path().moves
            body = Body(obstacle.path(), obstacle.shape())
            if at_rest and body.fills(goal, 0.0):
                raise InputError(
                    f"robots.{name}.route.goal_m",
                    f"({goal[0]:g}, {goal[1]:g}) is inside {obstacle.name!r}; move one "
                    "of them",
                )


def _start(robot: Robot) -> tuple[float, float]:
    x, y = control_point(robot.start.pose, robot.robot.control_point_m)
    return x, y
