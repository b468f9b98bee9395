"""Each cause of an end, in a scene where it must come at a known time."""

from __future__ import annotations

import gc
import weakref
from typing import Any

import numpy as np
import pytest

from diagrams import RunResult, build_sound_follower, make_simulator, simulate
from diagrams.scenario import Scenario, robot_rectangle
from diagrams.stop_rules import StopRules
from systems.geometry import rectangle_clearance

BASE: dict[str, Any] = {
    "law": "none",
    "hearing": "ideal",
    "obstacle_sensing": "ideal",
    "ideal_hearing": {"burst_gaps": False},
    "source": {"waypoints_m": [[4.0, 0.0]]},
    "duration_s": 3.0,
}
#: Neither spring nor avoidance: the robot waits where it is.
WAITING: dict[str, Any] = {"attraction": {"stiffness_n_m": 0.0}}


def run(**data: Any) -> RunResult:
    return simulate(Scenario.model_validate(BASE | data))


def test_a_run_leaves_no_simulator_behind():
    """Its monitor keeps the context, which keeps the simulator, which keeps it:
    Drake lets Python collect such a ring."""
    follower = build_sound_follower(Scenario.model_validate(BASE))
    simulator = make_simulator(follower)
    context = simulator.get_context()
    simulator.set_monitor(StopRules(follower))
    simulator.Initialize()
    simulator.AdvanceTo(0.1)
    alive = weakref.ref(simulator)
    del simulator, context
    gc.collect()
    assert alive() is None


def test_reached():
    """At the first tick at which P is within d_f + 0.3 m of a resting source."""
    result = run(source={"waypoints_m": [[2.5, 0.3]]}, duration_s=20.0)
    assert result.cause == "reached"
    distances = result.columns["source_range_true"]
    assert distances[-1] <= 1.5 < distances[-2]
    assert result.collision is None


def test_completed_is_for_a_moving_source():
    moving = {"waypoints_m": [[1.6, 0.0], [9.0, 0.0]]}
    result = run(source=moving)
    assert result.cause == "completed"
    assert result.simulated_s == pytest.approx(3.0)


def test_timeout_is_for_a_resting_one():
    result = run(duration_s=1.25)
    assert result.cause == "timeout"
    assert result.simulated_s == pytest.approx(1.25)


def test_stuck():
    result = run(**WAITING, stop={"stuck_after_s": 2.0})
    assert result.cause == "stuck"
    assert result.simulated_s == pytest.approx(2.0, abs=0.1)


def test_a_robot_at_its_goal_is_not_stuck():
    """A moving source that rests later, within the band from the start on."""
    source = {"waypoints_m": [[1.5, 0.0], [1.6, 0.0]], "speed_m_s": 0.05}
    result = run(**WAITING, source=source, stop={"stuck_after_s": 1.0})
    assert result.cause == "completed"


def test_lost():
    result = run(
        ideal_hearing={"maximum_range_m": 1.0, "burst_gaps": False},
        stop={"lost_after_s": 1.5},
    )
    assert result.cause == "lost"
    assert result.simulated_s == pytest.approx(1.5, abs=0.03)


def test_diverged():
    """The source leaves at 0.5 m/s from 1.825 m: 3 m away after 2.35 s."""
    source = {"waypoints_m": [[2.0, 0.0], [9.0, 0.0]], "speed_m_s": 0.5}
    result = run(**WAITING, source=source, stop={"diverged_range_m": 3.0})
    assert result.cause == "diverged"
    assert result.simulated_s == pytest.approx(2.35, abs=0.03)


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
    touch = (1.5 - 0.1 - 0.175) / 0.5
    assert touch <= result.collision.time <= touch + 0.0051


def test_turning_into_a_box_at_rest_is_the_robots_fault():
    """The bar's left end sweeps back onto a box behind it, and the centre leaves."""
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
    }
    result = run(**WAITING, start={"heading_deg": 45.0}, obstacles=[speck])
    assert result.collision is not None
    assert (result.collision.object, result.collision.fault) == ("speck", "obstacle")
    assert result.collision.time == pytest.approx(20.5 * 0.025, abs=0.005)

    robot = robot_rectangle(result.scenario.start.pose, result.scenario.robot)
    path = result.scenario.obstacles[0].path()
    for tick in range(40):
        body = np.array([*path.pose(tick * 0.025), 0.002, 0.002])
        assert rectangle_clearance(robot, body) > 0.0, "clear at every tick"


def test_a_near_miss_is_no_collision():
    """The same speck, passing the corner at 1 cm."""
    x, y = 0.585 / np.sqrt(2) + 0.01, -0.235 / np.sqrt(2)
    speck = {
        "waypoints_m": [[x, y + 20.5 * 0.075], [x, -5.0]],
        "size_m": [0.002, 0.002],
        "speed_m_s": 3.0,
    }
    result = run(
        **WAITING, start={"heading_deg": 45.0}, obstacles=[speck], duration_s=1.5
    )
    assert result.cause == "timeout"
