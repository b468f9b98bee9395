"""The library's families of layouts beside the papers': what all of them promise."""

from __future__ import annotations

import heapq
import math
from functools import cache

import numpy as np
import pytest

from analysis.batches.comparison_plans import comparison_plan
from diagrams import Scenario, load_scenario
from systems.world.geometry import nearest_point_on_rectangle, rectangle_corners

FAMILIES = ("clutter", "crowd", "rooms", "two_moving_obstacles_resting_source")
COUNT = 60
#: The robot's corners are so far from the origin of B, and 5 cm to spare.
RADIUS = math.hypot(0.175, 0.41) + 0.05
CELL = 0.05


@cache
def layouts(name: str) -> list[Scenario]:
    """The fixed layout, and random ones."""
    plan = comparison_plan(name, laws=("none",), runs=COUNT)
    return [load_scenario(name), *map(plan.scenario_of, plan.points())]


def outline(rectangle: np.ndarray) -> np.ndarray:
    """Points every centimeter or so along the sides."""
    corners = rectangle_corners(rectangle)
    part = np.linspace(0.0, 1.0, 64)[:, None]
    sides = zip(corners, np.roll(corners, 1, axis=0), strict=True)
    return np.vstack([a + part * (b - a) for a, b in sides])


@pytest.mark.parametrize("name", FAMILIES)
def test_nothing_stands_near_the_start(name):
    for scenario in layouts(name):
        start = np.array(scenario.only.start.position_m)
        for body in scenario.bodies().values():
            away = np.linalg.norm(outline(body.rectangles(0.0)[0]) - start, axis=1)
            assert away.min() >= 0.8


@pytest.mark.parametrize("name", FAMILIES)
def test_a_robot_can_stand_before_a_resting_source(name):
    for scenario in layouts(name):
        bodies = scenario.bodies()
        source = bodies.pop("source")
        if source.path.moves:
            continue
        points = outline(source.rectangles(0.0)[0])
        for body in bodies.values():
            if not body.path.moves:
                for point in points[::8]:
                    box = body.rectangles(0.0)[0]
                    away = math.hypot(*nearest_point_on_rectangle(point, box))
                    assert away >= 1.2


@pytest.mark.parametrize("name", ["clutter", "rooms"])
def test_the_robot_finds_a_way_on_a_grid(name):
    """Cells of 5 cm, no step off the free ones: another method than the draw's."""
    for scenario in layouts(name)[:20]:
        assert way_on_a_grid(scenario)


def way_on_a_grid(scenario: Scenario) -> bool:
    x, y = np.meshgrid(
        np.arange(-3.0, 9.0, CELL), np.arange(-5.0, 5.0, CELL), indexing="ij"
    )
    free = np.ones(x.shape, dtype=bool)
    for body in scenario.bodies().values():
        if not body.path.moves:
            box = body.rectangles(0.0)[0]
            free &= np.hypot(*nearest_point_on_rectangle((x, y), box)) >= RADIUS
    goal = np.array(scenario.source.waypoints_m[0])
    reach = scenario.follower.attraction.follow_distance_m + 0.175
    start_x, start_y = scenario.only.start.position_m
    queue = [(0.0, round((start_x + 3.0) / CELL), round((start_y + 5.0) / CELL))]
    while queue:
        _, i, j = heapq.heappop(queue)
        if not (0 <= i < free.shape[0] and 0 <= j < free.shape[1] and free[i, j]):
            continue
        free[i, j] = False
        away = math.hypot(x[i, j] - goal[0], y[i, j] - goal[1])
        if away <= reach:
            return True
        for di, dj in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            heapq.heappush(queue, (away, i + di, j + dj))
    return False


def test_clutter_is_ten_to_fourteen_boxes_on_the_way():
    counts = set()
    for scenario in layouts("clutter")[1:]:
        counts.add(len(scenario.obstacles))
        source = scenario.source.waypoints_m[0]
        assert 6.0 <= source[0] <= 6.5
        for box in scenario.obstacles:
            assert all(0.1 <= side <= 0.5 for side in box.size_m or ())
            assert 1.1 <= box.waypoints_m[0][0] <= 4.5
    assert counts == {10, 11, 12, 13, 14}


def test_crowds_cross_the_way_of_the_source_and_do_not_meet_it():
    for scenario in layouts("crowd"):
        bodies = scenario.bodies()
        source = bodies.pop("source")
        times = np.arange(0.0, scenario.duration_s, 0.25)
        for name, body in bodies.items():
            first, last = (body.path.pose(t)[1] for t in (0.0, 1e4))
            assert first * last < 0.0, f"{name} ends on the other side"
            for place, at in zip(body.rectangles_over(times)[0], times, strict=True):
                point = source.path.pose(at)[:2]
                assert math.hypot(*nearest_point_on_rectangle(point, place)) > 0.3
        assert all(0.15 <= body.speed_m_s <= 0.6 for body in scenario.obstacles)
        assert all(
            0.1 <= s <= 0.4 for body in scenario.obstacles for s in body.size_m or ()
        )


def test_rooms_have_one_door_off_the_axis_of_the_source():
    """A line along the wall between the rooms: free for 1.2 m, in one piece."""
    for scenario in layouts("rooms"):
        bodies = scenario.bodies()
        source = bodies.pop("source").path.pose(0.0)
        heights = np.arange(-3.0, 3.0, 0.01) + 0.005
        free = np.ones(len(heights), dtype=bool)
        for body in bodies.values():
            box = body.rectangles(0.0)[0]
            points = (np.full(len(heights), 2.5), heights)
            free &= np.hypot(*nearest_point_on_rectangle(points, box)) > 0.0
        door = heights[free]
        assert len(door) == pytest.approx(120, abs=1)
        assert np.ptp(door) == pytest.approx(1.19, abs=0.011)
        assert abs(door.mean() - source[1]) >= 0.6 - 0.006
        assert scenario.only.start.position_m[0] < 2.5 < source[0]


def test_two_bodies_cross_the_way_to_a_source_that_rests():
    for scenario in layouts("two_moving_obstacles_resting_source"):
        assert not scenario.source.path().moves
        sides = [np.array(o.waypoints_m)[:, 1] for o in scenario.obstacles]
        assert [side.prod() < 0.0 for side in sides] == [True, True]
        assert sides[0][0] * sides[1][0] < 0.0, "from both sides"


@pytest.mark.parametrize("name", FAMILIES)
def test_the_fixed_layout_is_one_that_may_be_drawn(name):
    plan = comparison_plan(name, laws=("none",), runs=1)
    scenario = load_scenario(name)
    plan.require.check(scenario)
    drawn = plan.scenario_of(plan.points()[0])
    if name != "clutter":
        assert [o.name for o in drawn.obstacles] == [o.name for o in scenario.obstacles]
