"""Computes the speeds of corners, which are the fastest points of turning bodies."""

from __future__ import annotations

import numpy as np

from diagrams.scenario.participants import Robot
from diagrams.scenario.scenario import Scenario
from systems.base.driven_path import DrivenPath
from systems.base.robot import body_radius
from systems.world.paths import WaypointPath
from systems.world.plane import rectangle_corners
from systems.world.shapes import Shape, box


def corner_speeds(scenario: Scenario, robot: str) -> dict[str, float]:
    """Returns the greatest speed of the corners of each body that a robot could touch.

    The corners of a turning rectangle are its fastest points.

    Args:
        scenario: Any scenario.
        robot: Name of a robot in the scenario.

    Returns:
        Greatest speed in the run, m/s, by name of the body. For another robot, it is
        the greatest speed that its wheels permit.
    """
    until = scenario.duration_s
    speeds = {
        each.name: _corner_speed(each.path(), each.shape(), until)
        for each in scenario.obstacles
    }
    for name, source in scenario.sources.items():
        if source.body:
            shape = box((source.length_m, source.width_m))
            speeds[name] = _corner_speed(source.path(), shape, until)
    for name, other in scenario.robots.items():
        if name != robot:
            speeds[name] = _reachable_speed(other)
    return speeds


def _corner_speed(path: WaypointPath | DrivenPath, shape: Shape, until: float) -> float:
    """Greatest corner speed, m/s, of a shape on a path until a time, s.

    A corner counts on both sides of the path, whatever the direction of the turn. A
    round corner moves as its center does: its outline does not change if it turns.
    """
    ahead, turn = np.abs(path.extreme_twists(until)).T
    x, y = np.abs(np.concatenate([*map(rectangle_corners, shape.rectangles)])).T
    corners = np.hypot(ahead + np.multiply.outer(y, turn), np.multiply.outer(x, turn))
    return float(np.max(corners, initial=0.0))


def _reachable_speed(robot: Robot) -> float:
    """Greatest possible speed of a corner of a robot, m/s.

    The robot drives straight ahead at top speed, or turns on the spot with both wheels
    at top speed. The larger corner speed counts.
    """
    body, faster = robot.robot, 1.0 + max(map(abs, robot.plant.slip))
    lever = 2.0 * body_radius(body) / body.wheel_separation_m
    return body.top_speed_m_s * faster * max(lever, 1.0)
