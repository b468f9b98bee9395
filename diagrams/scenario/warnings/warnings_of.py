"""Collects all warnings about a scenario; no other module creates them."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from diagrams.scenario.bodies import Body
from diagrams.scenario.participants import Router
from diagrams.scenario.scenario import Scenario
from diagrams.scenario.shorthand import field_in
from diagrams.scenario.warnings.angles import angle_warnings
from diagrams.scenario.warnings.guarantees import assumptions
from diagrams.scenario.warnings.route_gains import goal_warnings, route_warnings
from diagrams.scenario.warnings.scenario_warning import ScenarioWarning
from systems.world.plane import beyond_rectangle, control_point


def warnings_of(scenario: Scenario) -> tuple[ScenarioWarning, ...]:
    """Returns the warnings about a scenario that can still be run.

    The function warns in these cases:

    - A heading in degrees looks like one in radians.
    - The scenario violates an assumption of the theorems about the robot's guard.
    - The control point P starts nearer to a known obstacle than the clearance of the
      robot's route.
    - The robot cannot come to rest with its gains, or can hit obstacles.
    - Obstacles at rest keep the robot away from its goal.
    - A robot has gains of the user's own law, but another law.
    """
    found = [*angle_warnings(scenario)]
    for name, robot in scenario.robots.items():
        prefix = field_in("robots", name, "")
        if robot.own_gains and not robot.own_code:
            found.append(
                ScenarioWarning(
                    f"{prefix}own_gains.{next(iter(robot.own_gains))}",
                    f"has no effect, because the law {robot.law!r} is not your own; "
                    "runs that differ only in this gain are equal",
                )
            )
        if robot.own_guard is not None:
            found += (
                ScenarioWarning(f"{prefix}{each.field}", each.complaint)
                for each in assumptions(scenario, name)
                if not each.holds
            )
        if isinstance(robot, Router):
            found += _of_the_start(prefix, robot, scenario.mapped())
            found += route_warnings(prefix, robot, scenario.tick_s)
            margin_m = scenario.stop.goal_margin_m
            resting, known = _resting(scenario), scenario.mapped()
            found += goal_warnings(prefix, robot, resting, known, margin_m)
    return tuple(found)


def _resting(scenario: Scenario) -> dict[str, NDArray[np.float64]]:
    """(n, 6) rectangles in W of the obstacles at rest, by name."""
    return {
        each.name: Body(each.path(), each.shape()).rectangles(0.0)
        for each in scenario.all_obstacles
        if not each.path().moves
    }


def _of_the_start(
    prefix: str, robot: Router, known: NDArray[np.float64]
) -> Iterator[ScenarioWarning]:
    """Warns if the control point P starts too near to a known obstacle.

    The limit is the clearance of the robot's route. ``known`` contains the known
    obstacles as (k, 6) rectangles in the world frame W, m and rad.
    """
    place = control_point(robot.start.pose, robot.robot.control_point_m)
    off = (math.hypot(*beyond_rectangle(place, each)) for each in known)
    nearest, clearance = min(off, default=math.inf), robot.route.clearance_m
    if 0.0 < nearest < clearance:
        yield ScenarioWarning(
            f"{prefix}start.position_m",
            f"P starts {nearest:.3g} m from a known obstacle, within "
            f"{prefix}route.clearance_m, {clearance:g} m: the route first leads "
            "away from it",
        )
