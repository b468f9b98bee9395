"""How fast the corners of bodies move: those of a bar that turns outrun its middle."""

from __future__ import annotations

import numpy as np

from diagrams.scenario.participants import FollowerParameters
from diagrams.scenario.scenario import Scenario
from systems.base.driven_path import DrivenPath
from systems.base.robot import body_radius
from systems.world.paths import WaypointPath


def corner_speeds(scenario: Scenario, robot: str) -> dict[str, float]:
    """The greatest speed of a corner of each body that a robot could touch.

    Args:
        scenario: Any.
        robot: Name of a robot in it.

    Returns:
        m/s by name, until the end of the run; of another robot what its wheels can do.
    """
    until = scenario.duration_s
    speeds = {
        each.name: _corner_speed(each.path(), each.size_m, until)
        for each in scenario.obstacles
    }
    for name, source in scenario.all_sources.items():
        if source.body:
            size = source.length_m, source.width_m
            speeds[name] = _corner_speed(source.path(), size, until)
    for name, other in scenario.all_robots.items():
        if name != robot:
            speeds[name] = _reachable_speed(other)
    return speeds


def _corner_speed(
    path: WaypointPath | DrivenPath, size: tuple[float, float], until: float
) -> float:
    """Of the fastest corner of a rectangle on a path up to a time in s, m/s."""
    length, width = size
    ahead, turn = np.abs(path.extreme_twists(until)).T
    corners = np.hypot(ahead + 0.5 * width * turn, 0.5 * length * turn)
    return float(np.max(corners, initial=0.0))


def _reachable_speed(robot: FollowerParameters) -> float:
    """The greatest that a corner can have, m/s: both wheels ahead, or one back."""
    body, faster = robot.robot, 1.0 + max(map(abs, robot.plant.slip))
    lever = 2.0 * body_radius(body) / body.wheel_separation_m
    return body.top_speed_m_s * faster * max(lever, 1.0)
