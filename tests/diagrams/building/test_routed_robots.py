"""Robots on routes from end to end: by both engines, alone and among others."""

from __future__ import annotations

import numpy as np
import pytest
from pydrake.systems.framework import Diagram

from diagrams import build_sound_follower, load_scenario, simulate
from diagrams.scenario.warnings.warnings_of import warnings_of
from studies.object_sensing import SENSING
from studies.routes import outcomes
from systems.framework.input_error import InputError

BEAMS = "obstacle_sensing=ultrasonic", "ultrasonic.preset=scan_7"


@pytest.mark.parametrize(
    ("name", "law", "fields"),
    [
        ("unknown_block", "trajectory_adaptive", ()),
        ("unknown_block", "trajectory_filtered", BEAMS),
        ("unknown_block", "trajectory_filtered", ("obstacles=[]", "duration_s=5")),
        ("robots_2", "trajectory_filtered", ()),
    ],
)
def test_both_engines_do_the_same(name, law, fields):
    scenario = load_scenario(name, [f"law={law}", *fields])
    drake, compiled = (simulate(scenario, engine=e) for e in ("drake", "compiled"))
    assert drake.cause == compiled.cause
    assert drake.columns.keys() == compiled.columns.keys()
    for column, values in drake.columns.items():
        np.testing.assert_allclose(compiled.columns[column], values, atol=1e-9)


#: Four walls around the goal.
WALLED_IN = [
    {"name": f"wall {k}", "waypoints_m": [place], "size_m": size}
    for k, (place, size) in enumerate(
        [
            ([5.0, 0.0], [0.1, 2.1]),
            ([7.0, 0.0], [0.1, 2.1]),
            ([6.0, 1.0], [2.1, 0.1]),
            ([6.0, -1.0], [2.1, 0.1]),
        ]
    )
]
HEAD_ON = "obstacles.0.waypoints_m=[[3.0, 0.0]]", "route.replan=false", "duration_s=45"


@pytest.mark.parametrize("law", ["trajectory_conventional", "trajectory_adaptive"])
def test_eq_6_stops_the_robot_before_a_block(law):
    """P stays 0.2 m off a face at x = 2.8 m, less what it coasts in 50 ms."""
    field = "impedance.block_distance_m"
    free, held = (
        load_scenario("unknown_block", [f"law={law}", f"{field}={block_m}", *HEAD_ON])
        for block_m in ("null", "0.2")
    )
    assert simulate(free, engine="compiled").cause == "collision"
    drake, compiled = (simulate(held, engine=e) for e in ("drake", "compiled"))
    assert drake.cause == compiled.cause == "stuck"
    assert drake.columns.keys() == compiled.columns.keys()
    for column, values in drake.columns.items():
        np.testing.assert_allclose(compiled.columns[column], values, atol=1e-9)
    x, y = compiled.vector("p_WP")
    distance = np.hypot(np.maximum(2.8 - x, 0.0), np.maximum(np.abs(y) - 0.2, 0.0))
    assert 0.2 - 0.22 * 0.05 < distance.min() < 0.21
    # The target goes on and pulls; the virtual mass does not move.
    assert compiled.columns["attraction_x"][-1] > 3.0
    assert compiled.columns["v_WP_x"][-1] == pytest.approx(0.0, abs=1e-12)


def test_a_goal_is_reached_at_rest():
    result = simulate(load_scenario("known_u"), engine="compiled")
    assert result.cause == "reached"
    away = result.vector("p_WP")[:, -1] - [6.0, 0.0]
    assert np.hypot(*away) < 0.1
    assert np.hypot(*result.vector("v_WB")[:, -1]) < 0.05
    assert result.columns["replans"][-1] == 0.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scenario", "runs"),
    [("unknown_block", 40), ("crossing_obstacle", 40), ("unknown_wall", 20)],
)
def test_filtered_it_touches_nothing_and_arrives(scenario, runs):
    assert outcomes(scenario, "trajectory_filtered", runs) == {"reached": runs}


@pytest.mark.long
def test_with_72_beams_it_passes_walls_that_the_map_does_not_have():
    """What rests must rest to them, or the way is never planned anew."""
    settings = SENSING["72 beams"]
    found = outcomes("unknown_wall", "trajectory_filtered", 12, settings=settings)
    assert found == {"reached": 12}


@pytest.mark.slow
@pytest.mark.parametrize(("scenario", "runs"), [("robots_3", 15), ("robots_4", 15)])
def test_nor_do_several(scenario, runs):
    found = outcomes(scenario, "trajectory_filtered", runs)
    assert found["collision"] == 0
    assert found["reached"] >= 0.9 * runs


def test_four_robots_are_four_diagrams_that_see_one_another():
    """Each has blocks of its own, and the three others' poses before its sensor."""
    scenario = load_scenario("robots_4", ["robots.third.law=trajectory_adaptive"])
    root = build_sound_follower(scenario).diagram
    robots = {s.get_name(): s for s in root.GetSystems() if isinstance(s, Diagram)}
    assert robots.keys() == {"first", "second", "third", "fourth"}
    for name, robot in robots.items():
        blocks = {block.get_name(): block for block in robot.GetSystems()}
        assert len({type(block) for block in blocks.values()}) == len(blocks)
        assert ("impedance_adaptation" in blocks) == (name == "third")
        assert ("safety_filter" in blocks) == (name != "third")
        sensor = blocks["ideal_object_sensor"]
        assert sensor.GetInputPort("poses_WO").size() == 3 * 3
        assert sensor.GetInputPort("sizes").size() == 3 * 3


def test_the_same_seed_gives_the_same_bytes():
    noisy = ["objects.noise_m=0.02", "duration_s=20", "seed=5"]
    first, second, third = (
        simulate(load_scenario("robots_2", [*noisy, *more]), engine="compiled")
        for more in ([], [], ["seed=6"])
    )
    bytes_of = [run.trajectory.to_numpy().tobytes() for run in (first, second, third)]
    assert bytes_of[0] == bytes_of[1] != bytes_of[2]


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        (
            ["law=active"],
            "^route: is not a field of robots that follow .* trajectory_filtered$",
        ),
        (
            ["route=null"],
            "^route: is missing, and law .* drives on one; set route.goal_m",
        ),
        (
            ["obstacles.0.known=true", "route.goal_m=[3.0, 0.1]"],
            r"^route.goal_m: \(3, 0.1\) lies in a known obstacle",
        ),
        (
            [f"obstacles={WALLED_IN}"],
            "^route.goal_m: no route leads",
        ),
        (["route.clearance_m=0.1"], "^route.clearance_m"),
        (
            ["route.goal_m=[60, 0]", "stop.diverged_range_m=20"],
            "^route.goal_m: .* beyond stop.diverged_range_m, 20",
        ),
        (["guard={}"], "^guard: is not a field of robots that drive .* guarded, "),
    ],
)
def test_what_cannot_be_is_refused(fields, message):
    with pytest.raises(InputError, match=message):
        simulate(load_scenario("unknown_block", fields))


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        (
            ["robots.second.route.goal_m=[3.1, 0.1]"],
            "0.141 m from another robot's goal",
        ),
        (["robots.second.start.position_m=[-3.0, 0.1]"], "overlaps robot 'first'"),
        (["robots.second.route.clearance_m=0"], "^robots.second.route.clearance_m"),
    ],
)
def test_nor_what_two_robots_cannot(fields, message):
    with pytest.raises(InputError, match=message):
        simulate(load_scenario("robots_2", fields))


def test_a_start_within_the_clearance_is_told():
    """P at 0.08 m, the box from 0.2 m on: 0.12 m."""
    near = ["obstacles.0.known=true", "obstacles.0.waypoints_m=[[0.4, 0.0]]"]
    (warning,) = warnings_of(load_scenario("unknown_block", near))
    assert warning.field == "start.position_m"
    assert warning.message.startswith("P starts 0.12 m from a known obstacle")
    assert "route.clearance_m, 0.35 m" in warning.message
    assert not warnings_of(load_scenario("unknown_block"))


@pytest.mark.parametrize("known", [True, False])
def test_a_goal_beside_walls_is_reached(known):
    """Walls at 0.3 to 0.6 m beside the goal or ahead of it, on the map or not."""
    beside = [([1.5, -0.05 - off], [5.0, 0.1]) for off in (0.3, 0.45, 0.6)]
    ahead = [([3.05 + off, 0.0], [0.1, 1.0]) for off in (0.3, 0.5)]
    for place, size in beside + ahead:
        wall = {"waypoints_m": [place], "size_m": size, "name": "wall", "known": known}
        changes = {"route.goal_m": [3.0, 0.0], "obstacles": [wall]}
        scenario = load_scenario("unknown_block", changes)
        assert warnings_of(scenario) == () or place[1] == -0.35
        result = simulate(scenario, engine="compiled")
        assert result.cause == "reached", place
        replans = result.columns["replans"][-1]
        assert replans == 0 if known else replans <= 2


def test_a_wall_may_be_cut_into_pieces():
    """A wall of 5 m at 0.5 m beside the way, as 1, 3 or 16 obstacles."""
    ends = []
    for count in (1, 3, 16):
        size = 5.0 / count
        pieces = [
            {
                "name": f"piece {k}",
                "waypoints_m": [[-1.0 + (k + 0.5) * size, -0.55]],
                "size_m": [size, 0.1],
                "known": False,
            }
            for k in range(count)
        ]
        changes = {"obstacles": pieces, "route.replan": False, "duration_s": 20}
        changes["law"] = "trajectory_conventional"
        result = simulate(load_scenario("unknown_block", changes), engine="compiled")
        ends.append(result.vector("p_WP")[:, ::40])
    np.testing.assert_allclose(ends[1], ends[0], atol=1e-6)
    np.testing.assert_allclose(ends[2], ends[0], atol=1e-6)
    # The wall pushes P aside.
    assert np.max(ends[0][1]) > 0.1


@pytest.mark.parametrize(
    ("half_m", "sensing"),
    [
        (0.25, {"obstacle_sensing": "ideal"}),
        (0.29, {"obstacle_sensing": "ultrasonic", "ultrasonic": {"preset": "lidar"}}),
    ],
    ids=["6 cm on each side", "10 cm with a lidar"],
)
def test_a_pioneer_passes_a_door_in_whose_width_it_could_not_turn(half_m, sensing):
    """Straight on and at an angle, without contact.

    For beams, the edges of the door and their shadows seem to move.
    """
    for y in (0.0, 1.0):
        doors = [
            {"name": f"wall {side}", "waypoints_m": [[3.0, side * (1.0 + half_m)]],
             "size_m": [0.2, 2.0]}
            for side in (-1, 1)
        ]  # fmt: skip
        ends = [
            {"name": f"end {side}", "waypoints_m": [[3.0, side * 2.3]],
             "size_m": [9.0, 0.1]}
            for side in (-1, 1)
        ]  # fmt: skip
        sides = [
            {"name": f"side {x}", "waypoints_m": [[x, 0.0]], "size_m": [0.1, 4.7]}
            for x in (-1.5, 7.5)
        ]
        changes = {
            "robot": {"preset": "p3dx"},
            "start.position_m": [0.0, y],
            "route.goal_m": [6.0, y],
            "obstacles": doors + ends + sides,
            **sensing,
        }
        result = simulate(load_scenario("unknown_block", changes), engine="compiled")
        assert result.cause == "reached", y
        assert result.columns["replans"][-1] == 0.0
