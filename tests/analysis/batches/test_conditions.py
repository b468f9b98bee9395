"""What a sweep asks of layouts, against closed cases and a grid."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy import ndimage

from analysis.batches.conditions import Conditions
from analysis.batches.plan import SweepPlan
from diagrams import Scenario
from diagrams.scenario.scenario import scenario_from_mapping
from systems.framework.input_error import InputError
from systems.world.geometry import nearest_point_on_rectangle

RADIUS, CELL = 0.5, 0.05
#: Of the disc about the origin of B from a source at rest: follow distance and P.
REACH = 1.2 + 0.175


def layout(obstacles: list[dict[str, Any]], **fields: Any) -> Scenario:
    named = [{"name": f"box {k}", **box} for k, box in enumerate(obstacles)]
    source = {"waypoints_m": [[6.0, 0.0]]}
    return scenario_from_mapping({"source": source, **fields, "obstacles": named})


def lacks(scenario: Scenario, **conditions: float) -> str:
    """The condition that is not met; empty where all are."""
    try:
        Conditions(**conditions).check(scenario)
    except InputError as error:
        return error.field
    return ""


def wall_with_a_gap(gap: float, turned_deg: float = 0.0) -> list[dict[str, Any]]:
    """Round the robot's start: three sides, and the fourth with a gap."""
    half = (6.0 - gap) / 2.0
    walls = [
        ((2.0, 0.5 * (gap + half)), (0.1, half)),
        ((2.0, -0.5 * (gap + half)), (0.1, half)),
        ((-2.0, 0.0), (0.1, 6.0)),
        ((0.0, 3.0), (4.1, 0.1)),
        ((0.0, -3.0), (4.1, 0.1)),
    ]
    angle = math.radians(turned_deg)
    c, s = math.cos(angle), math.sin(angle)
    return [
        {
            "waypoints_m": [[c * x - s * y, s * x + c * y]],
            "size_m": list(size),
            "heading_deg": turned_deg,
        }
        for (x, y), size in walls
    ]


@pytest.mark.parametrize("turned", [0.0, 37.0, 180.0])
@pytest.mark.parametrize(
    ("gap", "field"),
    [
        (2.0 * RADIUS + 2.0 * CELL, ""),
        (2.0 * RADIUS + 0.001, ""),
        (2.0 * RADIUS - 0.001, "require.way_radius_m"),
        (2.0 * RADIUS - 2.0 * CELL, "require.way_radius_m"),
    ],
)
def test_a_disc_goes_through_gaps_that_are_as_wide(gap, turned, field):
    assert lacks(layout(wall_with_a_gap(gap, turned)), way_radius_m=RADIUS) == field


def test_a_disc_that_stands_too_near_has_no_way():
    near = [{"waypoints_m": [[-0.6, 0.0]], "size_m": [0.3, 0.3]}]
    assert lacks(layout(near), way_radius_m=0.44) == ""
    assert lacks(layout(near), way_radius_m=0.46) == "require.way_radius_m"


def test_what_moves_is_in_nobodys_way():
    walls = wall_with_a_gap(0.5)
    moving = [{**wall, "waypoints_m": [*wall["waypoints_m"], [9, 9]]} for wall in walls]
    assert lacks(layout(moving), way_radius_m=RADIUS) == ""


@pytest.mark.parametrize(("end", "field"), [(1.0, ""), (6.0, "require.way_radius_m")])
def test_the_way_leads_to_where_a_source_ends(end, field):
    source = {"waypoints_m": [[1.0, 0.5], [end, 0.0]]}
    scenario = layout(wall_with_a_gap(0.9), source=source)
    assert lacks(scenario, way_radius_m=RADIUS) == field


def test_every_robot_needs_a_way():
    scenario = layout(
        wall_with_a_gap(0.9),
        robots={"out": {"start": {"position_m": [4.0, 2.0]}}, "within": {}},
    )
    with pytest.raises(InputError, match="of 'within' to 'source'"):
        Conditions(way_radius_m=RADIUS).check(scenario)


@settings(max_examples=60)
@given(st.integers(0, 10_000), st.integers(8, 20))
def test_ways_are_those_of_a_grid(seed, count):
    """A flood over cells of 5 cm, which knows nothing of polygons and legs.

    A disc that is a cell wider flows through cells only where there is a way; one
    that is a cell narrower does wherever there is one.
    """
    rng = np.random.default_rng(seed)
    frame = [(3.0, y, 0.0, 8.2, 0.1) for y in (-2.0, 2.0)]
    frame += [(x, 0.0, 0.0, 0.1, 4.0) for x in (-1.0, 7.0)]
    scattered = np.column_stack(
        [
            rng.uniform([1.2, -1.8, 0.0], [4.2, 1.8, math.pi], (count, 3)),
            rng.uniform(0.1, 0.5, (count, 2)),
        ]
    )
    boxes = [*frame, *scattered.tolist()]
    scenario = layout(
        [
            {
                "waypoints_m": [[x, y]],
                "heading_deg": math.degrees(theta),
                "size_m": [length, width],
            }
            for x, y, theta, length, width in boxes
        ]
    )
    found = lacks(scenario, way_radius_m=RADIUS) == ""
    if flows(boxes, RADIUS + CELL):
        assert found
    if found:
        assert flows(boxes, RADIUS - CELL)


def flows(boxes: list[Any], radius: float) -> bool:
    x, y = np.meshgrid(
        np.arange(-1.0, 7.0, CELL), np.arange(-2.0, 2.0, CELL), indexing="ij"
    )
    free = np.ones(x.shape, dtype=bool)
    for box in boxes:
        free &= (
            np.hypot(*nearest_point_on_rectangle((x, y), np.array([*box, 0.0])))
            >= radius
        )
    parts, _ = ndimage.label(free)
    begin = parts[round(1.0 / CELL), round(2.0 / CELL)]
    goal = np.hypot(x - 6.0, y) <= REACH + CELL
    return bool(begin) and bool(np.any(goal & (parts == begin)))


@pytest.mark.parametrize("heading", [0.0, 90.0, 200.0])
def test_distance_from_the_start_is_from_the_axle_to_the_outline(heading):
    """A box of 0.4 m by 0.4 m whose center is 1 m off, along an axis of its own."""
    c, s = math.cos(math.radians(heading)), math.sin(math.radians(heading))
    box = {"waypoints_m": [[c, s]], "size_m": [0.4, 0.4], "heading_deg": heading}
    assert lacks(layout([box]), start_distance_m=0.799) == ""
    field = lacks(layout([box]), start_distance_m=0.801)
    assert field == "require.start_distance_m"


def test_what_moves_counts_where_it_is_at_time_zero():
    coming = {"waypoints_m": [[3.0, 0.0], [0.5, 0.0]]}
    going = {"waypoints_m": [[0.5, 0.0], [3.0, 0.0]]}
    assert lacks(layout([coming]), start_distance_m=0.8) == ""
    assert lacks(layout([going]), start_distance_m=0.8) == "require.start_distance_m"


def test_distance_from_a_source_is_between_outlines():
    """The master robot is 0.326 m long; the box's near side is 4.5 m off."""
    box = {"waypoints_m": [[4.4, 0.0]], "size_m": [0.2, 0.2]}
    between = 6.0 - 0.163 - 4.5
    assert lacks(layout([box]), source_distance_m=between - 0.001) == ""
    field = lacks(layout([box]), source_distance_m=between + 0.001)
    assert field == "require.source_distance_m"


def test_distance_from_a_source_is_kept_all_the_time():
    """A box that passes behind the source, 1 m from center to center."""
    box = {"waypoints_m": [[7.0, -2.0], [7.0, 2.0]], "size_m": [0.2, 0.2]}
    between = 1.0 - 0.163 - 0.1
    assert lacks(layout([box]), source_distance_m=between - 0.001) == ""
    field = lacks(layout([box]), source_distance_m=between + 0.001)
    assert field == "require.source_distance_m"
    assert lacks(layout([box], duration_s=3.0), source_distance_m=between + 0.2) == ""
    # The source drives off at the same speed.
    ahead = layout([box], source={"waypoints_m": [[6.0, 0.0], [6.0, 4.0]]})
    assert lacks(ahead, source_distance_m=1.0) == ""


def test_draws_that_lack_something_are_drawn_again():
    """Of boxes at y from -1 to 1 those within 0.8 m of the start are left out."""
    path = "obstacles.0.waypoints_m.0.1"
    plan = SweepPlan.model_validate(
        {
            "set": {
                "obstacles": [{"waypoints_m": [[0.65, 0.0]], "size_m": [0.1, 0.1]}]
            },
            "draw": {path: {"uniform": [-1.0, 1.0]}},
            "require": {"start_distance_m": 0.8},
            "runs": 400,
            "redraws": 50,
        }
    )
    points = plan.points()
    places = np.array([point.fields[path] for point in points])
    # Its near side is 0.6 m ahead, its near corner then sqrt(0.8^2 - 0.6^2) aside.
    least = math.sqrt(0.8**2 - 0.6**2) + 0.05
    assert least <= np.abs(places).min() < least + 0.02
    redraws = np.array([point.redraws for point in points])
    assert redraws.mean() == pytest.approx(least / (1.0 - least), rel=0.25)
    assert plan.points() == points
