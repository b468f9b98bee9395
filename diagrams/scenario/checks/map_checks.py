"""Checks that bodies and goals are not inside the walls of a map."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from diagrams.scenario.bodies import Body, robot_rectangle
from diagrams.scenario.map_parameters import MapParameters
from diagrams.scenario.participants import Robot, Router, SourceParameters
from systems.framework.input_error import InputError
from systems.world.parameters import ObstacleParameters


def check_map(
    walls: MapParameters | None,
    robots: Mapping[str, Robot],
    sources: Mapping[str, SourceParameters],
    obstacles: Iterable[ObstacleParameters],
) -> None:
    """Raises an error if a start, a goal or a waypoint is inside a wall.

    Waypoints of obstacles at rest are not checked, because such obstacles can be a part
    of a wall.

    Args:
        walls: Map of the scenario; None: there is no check.
        robots: Robots of the scenario, by name.
        sources: Sources of the scenario, by name.
        obstacles: Obstacles of the scenario.

    Raises:
        InputError: The body of a robot overlaps an occupied cell at its start, or a
            goal or a waypoint is in an occupied cell.
    """
    if walls is None:
        return
    body = Body(walls.path(), walls.shape())
    places: dict[str, Any] = {}
    for name, robot in robots.items():
        if body.clearance(robot_rectangle(robot.start.pose, robot.robot), 0.0) < 0.0:
            x, y = robot.start.position_m
            raise InputError(
                f"robots.{name}.start.position_m",
                f"({x:g}, {y:g}) is so near to an occupied cell of the map that the "
                "robot overlaps it; move the start to free floor",
            )
        if isinstance(robot, Router):
            places[f"robots.{name}.route.goal_m"] = (robot.route.goal_m,)
    for name, source in sources.items():
        places[f"sources.{name}.waypoints_m"] = source.waypoints_m
    for k, obstacle in enumerate(obstacles):
        if obstacle.path().moves:
            places[f"obstacles.{k}.waypoints_m"] = obstacle.waypoints_m
    for field, points in places.items():
        inside = walls.cells.covers(points)
        for x, y in np.array(points)[inside].tolist():
            raise InputError(
                field,
                f"({x:g}, {y:g}) is in an occupied cell of the map; move it to free "
                "floor",
            )
