"""Each cause of an end, in a scene where it must come at a known time."""

from __future__ import annotations

import gc
import math
import weakref
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from diagrams import (
    RunResult,
    build_sound_follower,
    load_scenario,
    make_simulator,
    simulate,
)
from diagrams.running import referee
from diagrams.running.monitor import Monitor
from diagrams.running.referee import Referee
from diagrams.running.stop_rules import FOUND, judge_search
from diagrams.scenario.bodies import robot_rectangle
from diagrams.scenario.scenario import Scenario
from systems.world.geometry import rectangle_clearance

BASE: dict[str, Any] = {
    "law": "none",
    "hearing": "ideal_always",
    "obstacle_sensing": "ideal",
    "source": {"waypoints_m": [[4.0, 0.0]]},
    "duration_s": 3.0,
}
#: Neither spring nor avoidance: the robot waits where it is.
WAITING: dict[str, Any] = {"attraction": {"stiffness_n_m": 0.0}}
#: The source does not sound during the run.
SILENT: dict[str, Any] = {"sound": {"start_s": 60.0}, "hearing": "ideal"}


def run(**data: Any) -> RunResult:
    return simulate(Scenario.model_validate(BASE | data))


def test_a_run_leaves_no_simulator_behind():
    """Its monitor keeps the context, which keeps the simulator, which keeps it:
    Drake lets Python collect such a ring."""
    follower = build_sound_follower(Scenario.model_validate(BASE))
    simulator = make_simulator(follower)
    context = simulator.get_context()
    simulator.set_monitor(Monitor(follower))
    simulator.Initialize()
    simulator.AdvanceTo(0.1)
    alive = weakref.ref(simulator)
    del simulator, context
    gc.collect()
    assert alive() is None


def at_rest_ahead(distance: float, **data: Any) -> RunResult:
    """A robot that waits with a resting source so far ahead of P."""
    source = {"waypoints_m": [[0.175 + distance, 0.0]]}
    return run(**(WAITING | {"source": source} | data))


def speed_of_P(result: RunResult) -> NDArray[np.float64]:
    """By differences of its place from tick to tick, m/s."""
    steps = np.hypot(*(np.diff(result.columns[f"p_WP_{axis}"]) for axis in "xy"))
    return steps / 0.025


def test_reached_is_at_rest_in_the_goal():
    """With a pull that does not swing, within d_f + 0.3 m for the last second."""
    damped = {"stiffness_n_m": 8.4, "damping_n_s_m": 8.4}
    source = {"waypoints_m": [[2.5, 0.3]]}
    result = run(attraction=damped, source=source, duration_s=30.0)
    assert result.cause == "reached"
    assert result.collision is None
    assert np.all(result.columns["source_range_true"][-40:] <= 1.5)
    speeds = speed_of_P(result)
    assert np.all(speeds[-40:] < 0.05)
    assert speeds[-42] > 0.05, "and not a tick later than that"


def test_flying_by_is_not_reaching():
    """The printed pull comes in at 0.5 m/s, runs past and swings to the end."""
    result = run(duration_s=12.0)
    distances = result.columns["source_range_true"]
    entry = int(np.flatnonzero(distances <= 1.5)[0])
    assert speed_of_P(result)[entry] > 0.5
    assert result.simulated_s == pytest.approx(12.0)
    assert result.cause == "unsettled"
    assert distances.max() > 1.5


def test_without_a_rest_time_flying_by_is_reaching():
    """The same run ends at its first tick in the goal, at 0.5 m/s."""
    result = run(duration_s=12.0, stop={"rest_time_s": 0.0})
    distances = result.columns["source_range_true"]
    assert result.cause == "reached"
    assert distances[-1] <= 1.5 < distances[-2]
    assert speed_of_P(result)[-1] > 0.5


def test_turning_on_the_spot_is_no_rest():
    """The center stands still at first, but P, ahead of it, sweeps round."""
    beside = {"waypoints_m": [[0.175, 1.3]]}
    pull = {"stiffness_n_m": 8.4, "damping_n_s_m": 8.4}
    result = run(source=beside, attraction=pull, duration_s=20.0)
    assert np.all(result.columns["source_range_true"] <= 1.5)
    assert result.cause == "reached"
    speeds = speed_of_P(result)
    last_fast = int(np.flatnonzero(speeds >= 0.05)[-1])
    assert last_fast > 20
    turned = result.columns["theta_WB"][last_fast] - result.columns["theta_WB"][0]
    assert turned > 0.2
    assert result.time[-1] == pytest.approx(result.time[last_fast] + 1.0, abs=0.051)


@pytest.mark.parametrize("distance", [0.6, 1.2, 1.45])
def test_at_rest_in_the_goal_is_reached_after_a_second(distance):
    result = at_rest_ahead(distance)
    assert result.cause == "reached"
    # The first target is there after two ticks.
    assert result.simulated_s == pytest.approx(1.05, abs=0.026)


@pytest.mark.parametrize("distance", [1.55, 1.9, 2.1])
def test_at_rest_outside_of_the_goal_is_stuck(distance):
    """Also within the band that counts as following a moving source."""
    result = at_rest_ahead(distance, stop={"stuck_after_s": 2.0})
    assert result.cause == "stuck"
    assert result.simulated_s == pytest.approx(2.05, abs=0.051)


@pytest.mark.parametrize("shift", [(5.0, -7.0), (-6.0, 4.0)])
@pytest.mark.parametrize(
    ("distance", "cause"), [(1.2, "reached"), (1.9, "stuck"), (1.3, "collision")]
)
def test_causes_are_the_same_elsewhere(shift, distance, cause):
    """At rest ahead, or hit by a cart from behind, before it has rested for long."""

    def end(x: float, y: float) -> tuple[str, float, float | None]:
        cart = {
            "name": "cart",
            # Touches between the instants that are looked at, by 0.5 mm or more.
            "waypoints_m": [[x - 0.503, y + 0.3], [x + 1.0, y + 0.3]],
            "size_m": [0.1, 0.1],
            "speed_m_s": 0.5,
        }
        result = at_rest_ahead(
            distance,
            start={"position_m": [x, y]},
            source={"waypoints_m": [[x + 0.175 + distance, y]]},
            stop={"stuck_after_s": 1.5},
            obstacles=[cart] if cause == "collision" else [],
        )
        hit = result.collision
        return result.cause, result.simulated_s, hit.time if hit else None

    assert end(*shift) == pytest.approx(end(0.0, 0.0), abs=1e-6)
    assert end(*shift)[0] == cause


def test_at_rest_in_the_goal_without_a_target_is_not_reached():
    """It rests because it is blind."""
    result = at_rest_ahead(1.2, **SILENT)
    assert result.cause == "lost"
    assert result.simulated_s == pytest.approx(3.0)
    result = at_rest_ahead(1.2, **SILENT, stop={"lost_after_s": 2.0})
    assert result.cause == "lost"
    assert result.simulated_s == pytest.approx(2.0, abs=0.03)


def test_what_rests_for_too_short_a_time_is_unsettled():
    result = at_rest_ahead(1.2, duration_s=0.9)
    assert result.cause == "unsettled"


def test_a_moving_source_that_is_followed():
    moving = {"waypoints_m": [[1.6, 0.0], [9.0, 0.0]]}
    result = run(source=moving)
    assert result.cause == "completed"
    assert result.simulated_s == pytest.approx(3.0)


def leaving(duration_s: float) -> RunResult:
    """P waits; the source leaves the band, 2 m, after 2.05 s, at 0.1 m/s.

    20 mm at its speed, 0.05 s for its start at 1 m/s^2, 0.05 s for its motors' lag.
    """
    source = {"waypoints_m": [[1.98, 0.0], [9.0, 0.0]], "speed_m_s": 0.1}
    return run(**WAITING, source=source, duration_s=duration_s)


@pytest.mark.parametrize(
    ("duration_s", "share", "cause"),
    [
        (3.9, 0.5, "completed"),  # 2.0 of 3.85 s
        (4.2, 0.5, "astray"),  # 2.0 of 4.15 s
        (4.2, 0.45, "completed"),
        (3.9, 0.55, "astray"),
    ],
)
def test_completed_needs_a_share_of_following(duration_s, share, cause, monkeypatch):
    monkeypatch.setattr(referee, "FOLLOWING_SHARE", share)
    assert leaving(duration_s).cause == cause


def test_a_moving_source_that_is_not_followed_and_gone_is_lost():
    """The last detection is at 2.1 s, and the target is forgotten 1 s later."""
    source = {"waypoints_m": [[1.98, 0.0], [9.0, 0.0]], "speed_m_s": 0.1}
    result = run(
        **WAITING,
        source=source,
        tracker={"maximum_age_s": 1.0},
        sound={"on_s": 2.1, "period_s": 20.0},
        hearing="ideal",
        duration_s=8.0,
    )
    assert result.simulated_s == pytest.approx(8.0)
    assert result.cause == "lost"


def test_a_moving_source_that_is_never_heard_is_lost():
    """Though P is within the band all the time."""
    source = {"waypoints_m": [[1.5, 0.0], [1.6, 0.0]], "speed_m_s": 0.05}
    result = run(**WAITING, **SILENT, source=source)
    assert result.simulated_s == pytest.approx(3.0)
    assert result.cause == "lost"


def test_time_over_on_the_way_to_a_resting_source():
    result = run(duration_s=1.25)
    assert result.cause == "timeout"
    assert result.simulated_s == pytest.approx(1.25)


def test_a_robot_in_the_band_of_a_moving_source_is_not_stuck():
    """A moving source that rests later, within the band from the start on."""
    source = {"waypoints_m": [[1.9, 0.0], [2.1, 0.0]], "speed_m_s": 0.05}
    result = run(**WAITING, source=source, stop={"stuck_after_s": 1.0})
    assert result.cause == "completed"


def test_lost():
    result = run(**SILENT, stop={"lost_after_s": 1.5})
    assert result.cause == "lost"
    assert result.simulated_s == pytest.approx(1.5, abs=0.03)


def test_diverged():
    """The source leaves at 0.5 m/s from 1.825 m: 3 m away after 2.35 s.

    Its start of 1 m/s^2 takes half of v/a longer.
    """
    source = {"waypoints_m": [[2.0, 0.0], [9.0, 0.0]], "speed_m_s": 0.5}
    result = run(**WAITING, source=source, stop={"diverged_range_m": 3.0})
    assert result.cause == "diverged"
    assert result.simulated_s == pytest.approx(2.35 + 0.25, abs=0.03)


def test_robot_that_drives_into_a_box_is_at_fault():
    box = {"name": "box", "waypoints_m": [[1.0, 0.1]], "size_m": [0.1, 0.1]}
    result = run(obstacles=[box], duration_s=20.0)
    assert result.cause == "collision"
    assert result.collision is not None
    assert (result.collision.object, result.collision.fault) == ("box", "robot")
    # The front is P's line: it touches the box's face at x = 0.95.
    assert result.columns["p_WP_x"][-1] == pytest.approx(0.95, abs=0.02)


def test_box_that_drives_into_a_waiting_robot_is_at_fault():
    """From x = 1.5, half 0.1 long, to the front at 0.175, with 0.5 m/s."""
    box = {
        "name": "cart",
        "waypoints_m": [[1.5, 0.1], [-1.0, 0.1]],
        "size_m": [0.2, 0.1],
        "speed_m_s": 0.5,
    }
    result = run(**WAITING, obstacles=[box])
    assert result.cause == "collision"
    assert result.collision is not None
    assert (result.collision.object, result.collision.fault) == ("cart", "obstacle")
    touch = (1.5 - 0.1 - 0.175) / 0.5 + 0.5 * 0.5  # and half of v/a to start
    assert touch <= result.collision.time <= touch + 0.0051


def test_a_finer_integration_is_judged_no_more_often():
    """The cart comes at 2.702 s: 2.705 s by fifths of ticks, and 2.725 s is a tick."""
    cart = {
        "name": "cart",
        "waypoints_m": [[1.501, 0.1], [-1.0, 0.1]],
        "size_m": [0.2, 0.1],
        "speed_m_s": 0.5,
    }
    for step_s in (0.025, 0.005):
        result = run(**WAITING, obstacles=[cart], integration_step_s=step_s)
        assert result.collision is not None
        assert result.collision.time == pytest.approx(2.705)
        assert result.simulated_s == pytest.approx(2.725)


def test_turning_into_a_box_at_rest_is_the_robots_fault():
    """The bar's left end sweeps back onto a box behind it, and the center leaves."""
    box = {"name": "box", "waypoints_m": [[-0.3, 0.3]], "size_m": [0.1, 0.1]}
    result = run(source={"waypoints_m": [[0.6, 2.4]]}, obstacles=[box], duration_s=20.0)
    assert result.collision is not None
    assert (result.collision.object, result.collision.fault) == ("box", "robot")
    before, now = result.poses("WB")[-2:]
    away = now[:2] - before[:2]
    assert away @ (np.array([-0.3, 0.3]) - before[:2]) < 0.0


def test_the_source_can_be_hit_too():
    result = run(
        source={"waypoints_m": [[1.2, 0.0]]},
        attraction={"follow_distance_m": 0.0},
        stop={"goal_margin_m": 0.001},
        duration_s=20.0,
    )
    assert result.cause == "collision"
    assert result.collision is not None
    assert (result.collision.object, result.collision.fault) == ("source", "robot")


def test_contact_between_two_ticks_is_found():
    """A speck passes a corner 1 cm deep at 3 m/s: 7 ms of contact, mid-tick.

    Turned by 45 deg, the robot's foremost corner lies at
    ((0.175 + 0.41) / sqrt 2, (0.175 - 0.41) / sqrt 2).
    """
    x, y = 0.585 / np.sqrt(2) - 0.01, -0.235 / np.sqrt(2)
    speck = {
        "name": "speck",
        "waypoints_m": [[x, y + 20.5 * 0.075], [x, -5.0]],
        "size_m": [0.002, 0.002],
        "speed_m_s": 3.0,
        "acceleration_m_s2": 1e6,
    }
    result = run(**WAITING, start={"heading_deg": 45.0}, obstacles=[speck])
    assert result.collision is not None
    assert (result.collision.object, result.collision.fault) == ("speck", "obstacle")
    assert result.collision.time == pytest.approx(20.5 * 0.025, abs=0.005)

    robot = robot_rectangle(result.scenario.only.start.pose, result.scenario.only.robot)
    path = result.scenario.obstacles[0].path()
    for tick in range(40):
        body = np.array([*path.pose(tick * 0.025), 0.002, 0.002, 0.0])
        assert rectangle_clearance(robot, body) > 0.0, "clear at every tick"


def test_a_near_miss_is_no_collision():
    """The same speck, passing the corner at 1 cm."""
    x, y = 0.585 / np.sqrt(2) + 0.01, -0.235 / np.sqrt(2)
    speck = {
        "waypoints_m": [[x, y + 20.5 * 0.075], [x, -5.0]],
        "size_m": [0.002, 0.002],
        "speed_m_s": 3.0,
        "acceleration_m_s2": 1e6,
    }
    result = run(
        **WAITING, start={"heading_deg": 45.0}, obstacles=[speck], duration_s=1.5
    )
    assert result.cause == "timeout"


@pytest.mark.parametrize("engine", ["drake", "compiled"])
def test_a_fast_robot_does_not_pass_through_a_film(engine):
    """At 0.6 m a tick the film lies ahead of the body at one tick, and then behind."""
    result = simulate(
        Scenario.model_validate(
            BASE
            | {
                "robot": {"mass_kg": 0.05, "top_speed_m_s": 25.0},
                "attraction": {"stiffness_n_m": 100.0},
                "source": {"waypoints_m": [[18.0, 0.0]]},
                "obstacles": [
                    {
                        "name": "film",
                        "waypoints_m": [[9.0, 0.0]],
                        "size_m": [0.001, 4.0],
                    }
                ],
            }
        ),
        engine=engine,
    )
    assert result.cause == "collision"
    assert result.collision is not None
    assert (result.collision.object, result.collision.fault) == ("film", "robot")
    x, face = result.columns["p_WB_x"], 9.0 - 0.0005 - 0.175
    ahead = int(np.flatnonzero(x > face)[0])
    part = (face - x[ahead - 1]) / (x[ahead] - x[ahead - 1])
    touch = 0.025 * (ahead - 1 + part)
    assert touch <= result.collision.time <= touch + 0.005
    assert x[ahead] - x[ahead - 1] > 0.5


@pytest.mark.parametrize("engine", ["drake", "compiled"])
@pytest.mark.parametrize("speed", [20.0, 100.0])
def test_a_shot_is_found_whatever_its_phase(engine, speed):
    """A speck that crosses the waiting body, 0.35 m long, within a tick."""
    hits = 0
    for phase in range(12):
        begin = 4.0 + speed * 0.025 * phase / 12.0
        speck = {
            "name": "speck",
            "waypoints_m": [[begin, 0.4], [-9.0, 0.4]],
            "size_m": [0.002, 0.002],
            "speed_m_s": speed,
            "acceleration_m_s2": 1e6,
        }
        scenario = Scenario.model_validate(
            BASE | WAITING | {"obstacles": [speck], "duration_s": 0.5}
        )
        result = simulate(scenario, engine=engine)
        assert result.collision is not None
        assert result.collision.object == "speck"
        assert result.collision.fault == "obstacle"
        touch = (begin - 0.001 - 0.175) / speed + 0.5 * speed / 1e6
        assert touch <= result.collision.time <= touch + 0.0051
        hits += 1
    assert hits == 12


def test_corners_are_not_cut_however_fast():
    """At 50 m/s a fifth of a tick is 0.25 m, and so is the corner's radius: the chord
    between such instants would cut it by 36 mm, and pass the robot's corner."""
    x, y = 0.175 - 0.03, 0.41 - 0.03
    hits = 0
    for outside in (False, True):
        shift = 0.05 if outside else 0.0
        # The arc's foremost point lies inside of the body's corner, or clear of it.
        radius = 0.25
        tip = (radius / math.cos(math.pi / 4) - radius) / math.sqrt(2)
        corner = x + shift - tip, y + shift - tip
        cart = {
            "name": "cart",
            "waypoints_m": [
                [corner[0] + 3.0, corner[1]],
                [*corner],
                [corner[0], corner[1] + 3.0],
            ],
            "corner_radius_m": radius,
            "size_m": [0.002, 0.002],
            "speed_m_s": 50.0,
            "acceleration_m_s2": 1e6,
        }
        result = run(**WAITING, obstacles=[cart], duration_s=0.3)
        path = result.scenario.obstacles[0].path()
        robot = robot_rectangle(
            result.scenario.only.start.pose, result.scenario.only.robot
        )
        dense = [
            rectangle_clearance(robot, np.array([*path.pose(t), 0.002, 0.002, 0.0]))
            for t in np.linspace(0.0, 0.2, 8001)
        ]
        assert (result.cause == "collision") == (min(dense) < 0.0) == (not outside)
        hits += int(not outside)
    assert hits == 1


@pytest.mark.parametrize(
    ("searches", "ended", "place", "cause"),
    [
        ("odor_search", 0, (0.1, 0.0), ""),
        ("odor_search", 1, (0.21, 0.0), "found"),
        ("odor_search", 1, (0.23, 0.0), "false find"),
        ("odor_search", 1, (0.05, 0.15), "found"),  # 71.6 deg off
        ("odor_search", 1, (0.03, 0.15), "false find"),  # 78.7 deg
        ("odor_search", 2, (0.1, 0.0), "lost"),
        ("sound_search", 1, (-0.4, 0.4), "found"),  # 0.57 m, behind
        ("sound_search", 1, (-0.5, 0.4), "false find"),
        ("sound_search", 1, (21.0, 0.0), "diverged"),
    ],
)
def test_a_find_is_judged_by_where_the_source_is(searches, ended, place, cause):
    """The robot is at (2, 1), turned by 30 deg; places are ahead and left of it."""
    scenario = load_scenario(searches)
    (step,) = Referee(scenario).steps.values()
    rules = step.numbers.rules
    c, s = math.cos(math.pi / 6), math.sin(math.pi / 6)
    ahead, left = place
    source = 2.0 + c * ahead - s * left, 1.0 + s * ahead + c * left
    found = judge_search(float(ended), (2.0, 1.0, math.pi / 6), source, rules)
    assert FOUND[found] == cause
