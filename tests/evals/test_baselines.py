"""Baselines in whole runs: both engines, and what their sources lead one to expect."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.batches.comparison_plans import comparison_plan
from diagrams import load_scenario, simulate

pytestmark = pytest.mark.slow

#: Not the seed with which their settings were chosen.
SEED, LAYOUTS = 2026, 10


def runs(name, law):
    settings = {"hearing": "ideal"}
    plan = comparison_plan(name, laws=[law], runs=LAYOUTS, seed=SEED, settings=settings)
    scenarios = [plan.scenario_of(point) for point in plan.points()]
    compiled = [simulate(scenario, engine="compiled") for scenario in scenarios]
    assert_same(simulate(scenarios[0], engine="drake"), compiled[0])
    return compiled


def assert_same(drake, compiled):
    assert drake.cause == compiled.cause
    assert drake.columns.keys() == compiled.columns.keys()
    for column, values in drake.columns.items():
        # Speeds are differences of places over a tick.
        atol = 1e-6 if "speed" in column else 1e-9
        np.testing.assert_allclose(
            compiled.columns[column], values, rtol=0.0, atol=atol, err_msg=column
        )


@pytest.mark.parametrize("law", ["dwa", "vfh_plus", "mppi"])
def test_a_map_of_echoes_is_enough_for_two_boxes(law):
    """What rests is not touched, and most runs arrive (docs/results_laws.md)."""
    found = runs("two_static_obstacles", law)
    assert all(run.collision is None for run in found)
    assert sum(run.cause == "reached" for run in found) >= LAYOUTS - 2


def test_who_only_stops_touches_nothing_that_rests_and_rarely_arrives():
    found = runs("two_static_obstacles", "stop_when_near")
    assert all(run.collision is None for run in found)
    assert sum(run.cause == "reached" for run in found) <= 3


def test_perfect_knowledge_is_hit_by_nobody():
    """ORCA's promise, of bodies that keep their course (van den Berg, section 3)."""
    found = runs("two_moving_obstacles", "orca")
    assert all(run.collision is None for run in found)
    assert all(run.cause == "completed" for run in found)


LIDAR = {"ultrasonic.preset": "lidar", "ultrasonic.noise_m": 0.0}


def box(name, x, y, length, width):
    return {"name": name, "waypoints_m": [[x, y]], "size_m": [length, width]}


def ended(law, source, boxes=(), **settings):
    """A run from the origin along x, with exact hearing at every tick."""
    fields = {
        "law": law,
        "hearing": "ideal_always",
        "start.position_m": [0.0, 0.0],
        "start.heading_deg": 0.0,
        "source.waypoints_m": [[*source]],
        "obstacles": [*boxes],
        "duration_s": 40.0,
        **settings,
    }
    return simulate(load_scenario("obstacle_free", fields), engine="compiled")


ROOMS = [box("left", 2.0, 2.15, 8.0, 0.1), box("right", 2.0, -2.15, 8.0, 0.1)]


@pytest.mark.parametrize(("law", "door"), [("dwa", 2.6), ("dwa", 1.4), ("mppi", 2.0)])
def test_a_door_straight_ahead_is_passed(law, door):
    """A robot that prefers free arcs circles in the first room for ever."""
    side = 2.1 - 0.5 * door
    at = 0.5 * door + 0.5 * side
    walls = [box("a", 3.0, at, 0.2, side), box("b", 3.0, -at, 0.2, side)]
    assert ended(law, (6.5, 0.0), [*walls, *ROOMS]).cause == "reached"


@pytest.mark.parametrize("law", ["dwa", "mppi", "vfh_plus"])
def test_one_box_is_passed_however_far_the_goal_is(law):
    """A threshold on the whole way would call the detour straight."""
    assert ended(law, (10.0, 0.0), [box("box", 3.0, 0.0, 0.3, 0.6)]).cause == "reached"


@pytest.mark.parametrize("half", [0.7, 1.05])
def test_a_dead_end_in_view_is_not_rammed(half):
    """The first wall is reached after 5 s at 0.62 m/s."""
    walls = [box("l", 0.0, half, 6.2, 0.1), box("r", 0.0, -half, 6.2, 0.1)]
    end = box("end", 3.0, 0.0, 0.2, 2.0 * half + 0.1)
    run = ended("dwa", (6.0, 0.0), [*walls, end], **LIDAR, duration_s=12.0)
    assert run.collision is None


@pytest.mark.parametrize("law", ["dwa", "mppi", "vfh_plus"])
@pytest.mark.parametrize("follow", [0.3, 0.7])
def test_the_source_is_reached_and_not_touched(law, follow):
    """Formerly MPPI hit the source in 11 of 12 places, and VFH+ in 5."""
    for source in ((4.1, 0.43), (-2.13, 0.61)):
        run = ended(law, source, **{"attraction.follow_distance_m": follow})
        assert run.collision is None
        far = np.hypot(
            *(run.columns[f"p_WP_{k}"][-1] - source[i] for i, k in enumerate("xy"))
        )
        assert far < follow + 0.3


@pytest.mark.parametrize("sensors", [LIDAR, {}])
@pytest.mark.parametrize("aside", [0.0, 0.6])
def test_a_desk_before_the_robot_is_left(sensors, aside):
    """The front is 0.2 m before the desk, or before its end (kobuki-x, issue 33)."""
    desk = box("desk", 0.475, aside, 0.2, 1.4)
    assert ended("dwa", (4.0, 0.0), [desk], **sensors).cause == "reached"


@pytest.mark.parametrize("law", ["dwa", "mppi"])
@pytest.mark.parametrize("x", [4.0, -4.0])
def test_a_corridor_in_which_the_body_can_turn_is_enough(law, x):
    """1.2 m wide; the diagonal of the body is 0.89 m (Nav2, issue 4049)."""
    walls = [box("l", 0.0, 0.65, 14.0, 0.1), box("r", 0.0, -0.65, 14.0, 0.1)]
    assert ended(law, (x, 0.0), walls, duration_s=60.0).cause == "reached"


@pytest.mark.parametrize("law", ["dwa", "mppi"])
def test_who_has_arrived_stands_until_the_source_leaves(law):
    """For 10 s it moves by less than 1 cm; the source then leaves with 0.3 m/s."""
    run = ended(
        law,
        (3.0, 1.0),
        **{
            "source.waypoints_m": [[3.0, 1.0], [3.01, 1.0], [7.0, 1.0]],
            "source.start_time_s": 20.0,
            "source.speed_m_s": 0.3,
            "duration_s": 35.0,
        },
    )
    assert run.collision is None
    times, place = np.arange(len(run.columns["p_WP_x"])) * 0.025, run.columns["p_WP_x"]
    still = place[(times > 10.0) & (times < 20.0)]
    assert np.ptp(still) < 0.01
    assert place[-1] > still[-1] + 1.0


@pytest.mark.parametrize("source", [(1.7, -1.7), (1.8, 1.8), (-1.9, 0.3)])
def test_a_small_robot_rests_beside_the_walls_of_a_small_room(source):
    """Less than one turn with VFH+ until it rests."""
    walls = [
        box("n", 0.0, 2.475, 5.05, 0.1),
        box("s", 0.0, -2.475, 5.05, 0.1),
        box("e", 2.475, 0.0, 0.1, 4.85),
        box("w", -2.475, 0.0, 0.1, 4.85),
    ]
    small = {
        "robot.preset": "turtlebot3_burger",
        "ultrasonic.positions_m": [[-0.08, 0.0]],
        "attraction.follow_distance_m": 0.3,
        "source.length_m": 0.02,
        "source.width_m": 0.02,
    }
    run = ended("vfh_plus", source, walls, **LIDAR, **small)
    assert run.cause == "reached"
    turned = np.abs(np.diff(np.unwrap(run.columns["theta_WB"]))).sum()
    assert turned < 2.0 * np.pi


@pytest.mark.parametrize("x", [-2.5, -3.0, -4.0])
def test_orca_turns_to_a_source_exactly_behind(x):
    assert ended("orca", (x, 0.0)).cause == "reached"
