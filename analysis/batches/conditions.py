"""Conditions that a sweep can place on its layouts besides being valid scenarios."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from diagrams.scenario.bodies import Body, Surroundings
from diagrams.scenario.scenario import Scenario
from systems.framework.input_error import InputError
from systems.framework.parameters import Length, NonNegativeLength, Parameters
from systems.world.plane import beyond_rectangle
from systems.world.shapes import box

#: Time between two checks of the distances of moving bodies, s.
STEP_S = 0.1


class Conditions(Parameters):
    """Distances that a layout must keep, and a path that it must leave free."""

    start_distance_m: NonNegativeLength = 0.0
    """Least distance at time zero from the origin of each robot's frame B (the middle
    of the wheel axle) to the outline of any body, m."""
    source_distance_m: NonNegativeLength = 0.0
    """Least distance between the outlines of a source and an obstacle during the whole
    run, m."""
    way_radius_m: Length | None = None
    """Radius of a disc around the origin of B, m. There must be a path on which this
    disc passes between the obstacles at rest. The path leads from each robot's start
    to a place where the control point P can be at the follow distance from the
    source."""

    def check(self, scenario: Scenario) -> None:
        """Raises InputError if a layout violates a condition, which the error names."""
        if self == Conditions():
            return
        self._check_source(scenario)
        for robot in scenario.robots:
            around = scenario.surroundings(robot)
            self._check_start(scenario, robot, around)
            self._check_way(scenario, robot, around)

    def _check_start(
        self, scenario: Scenario, robot: str, around: Surroundings
    ) -> None:
        if not self.start_distance_m:
            return
        start = scenario.robots[robot].start.position_m
        for name, body in around.bodies.items():
            away = body.distance(start, 0.0)
            if away < self.start_distance_m:
                raise InputError(
                    "require.start_distance_m",
                    f"{name!r} is {away:.3g} m from the start of {robot!r}, less than "
                    f"{self.start_distance_m:g} m; move it",
                )

    def _check_source(self, scenario: Scenario) -> None:
        obstacles = [Body(each.path(), each.shape()) for each in scenario.all_obstacles]
        if not self.source_distance_m or not obstacles:
            return
        from analysis.runs.proximity import least_clearances  # compiles code

        for name, source in scenario.sources.items():
            # These are planned positions. The source stays within centimeters of them.
            plan = Body(source.plan(), box((source.length_m, source.width_m)))
            moves = any(body.path.moves for body in (plan, *obstacles))
            times = np.arange(0.0, scenario.duration_s if moves else STEP_S, STEP_S)
            own = plan.rectangles_over(times - source.start_time_s)[0]
            begin = plan.path.pose(-source.start_time_s)[:2]
            least = [
                -math.inf
                if body.fills(begin, 0.0)
                else least_clearances(own, body.rectangles_over(times))[1].min()
                for body in obstacles
            ]
            nearest = int(np.argmin(least))
            if least[nearest] < self.source_distance_m:
                raise InputError(
                    "require.source_distance_m",
                    f"{scenario.all_obstacles[nearest].name!r} comes within "
                    f"{max(least[nearest], 0.0):.3g} m of {name!r}, less than "
                    f"{self.source_distance_m:g} m; move one of them",
                )

    def _check_way(self, scenario: Scenario, robot: str, around: Surroundings) -> None:
        if self.way_radius_m is None:
            return
        own = scenario.robots[robot]
        goal = around.followed.path.pose(scenario.duration_s)[:2]
        reach = own.follow_distance_m + own.robot.control_point_m
        still = [body for body in around.obstacles.values() if not body.path.moves]
        boxes = tuple(tuple(r) for body in still for r in body.rectangles(0.0).tolist())
        start = own.start.position_m
        inside = any(body.fills(goal, 0.0) for body in still)
        if inside or not _has_way(start, goal, reach, boxes, self.way_radius_m):
            raise InputError(
                "require.way_radius_m",
                f"obstacles at rest leave no path for a disc of {self.way_radius_m:g} "
                f"m from the start of {robot!r} to {around.target!r}; move some of "
                "them, or lower the radius",
            )


# All cells of a paired sweep have the same layouts and need the same answer.
@lru_cache(maxsize=16)
def _has_way(
    start: tuple[float, float],
    goal: tuple[float, float],
    reach: float,
    boxes: tuple[tuple[float, ...], ...],
    radius: float,
) -> bool:
    from analysis.runs.shortest_path import shortest_path_length  # compiles code

    rectangles = np.array(boxes).reshape(-1, 6)
    # The search for the shortest path accepts a start that is nearer than the radius
    # to an obstacle. This check does not.
    away = (math.hypot(*beyond_rectangle(start, box)) for box in rectangles)
    return min(away, default=math.inf) >= radius and math.isfinite(
        shortest_path_length(start, goal, reach, rectangles, radius)
    )
