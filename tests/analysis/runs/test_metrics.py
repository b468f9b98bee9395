"""Metrics of motions whose figures can be worked out by hand."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from analysis.runs.metrics import run_metrics
from analysis.runs.proximity import Proximity
from diagrams.scenario import Scenario
from diagrams.simulation import COLUMNS, RunResult
from diagrams.stop_rules import Collision
from systems.ultrasonic_array import UltrasonicParameters, cone_ranges

TICK = 0.025
#: Half the robot's length: P and its front face.
FRONT = 0.175
#: Half its width.
SIDE = 0.41


def motion(
    x, y, theta, *, cause: str = "completed", columns: Any = None, **scenario: Any
) -> RunResult:
    """A run with the origin of B at these places, tick by tick; nothing else."""
    settings = Scenario.model_validate({"hearing": "ideal", **scenario})
    time = np.arange(len(x)) * TICK
    source = settings.bodies()["source"].path.poses(time)
    names = [name for group in COLUMNS.values() for name in group]
    table: dict[str, Any] = {name: np.zeros(len(x)) for name in names}
    table["t"] = time
    table["p_WB_x"], table["p_WB_y"], table["theta_WB"] = x, y, theta
    table["v_WB_x"], table["v_WB_y"] = np.gradient(x, TICK), np.gradient(y, TICK)
    table["omega_WB"] = np.gradient(theta, TICK)
    table["p_WS_x"], table["p_WS_y"], table["theta_WS"] = source.T
    table["p_WP_x"] = x + FRONT * np.cos(theta)
    table["p_WP_y"] = y + FRONT * np.sin(theta)
    dx, dy = source[:, 0] - table["p_WP_x"], source[:, 1] - table["p_WP_y"]
    table["source_range_true"] = np.hypot(dx, dy)
    table["source_bearing_true"] = np.arctan2(dy, dx) - theta
    return RunResult(settings, cause, None, table | (columns or {}), 1.0)


def straight(speed: float = 0.5, ticks: int = 161, **scenario: Any) -> RunResult:
    """Along the x axis from the origin, for 4 s."""
    x = speed * TICK * np.arange(ticks)
    return motion(x, np.zeros(ticks), np.zeros(ticks), **scenario)


BOX = {"name": "box", "size_m": [0.1, 0.1], "waypoints_m": [[1.0, 0.6]]}
RESTING = {"waypoints_m": [[3.675, 0.0]]}


def test_passing_a_box():
    """Its near face is at y = 0.55, the bar's end at 0.41."""
    metrics = run_metrics(straight(obstacles=[BOX], source=RESTING))
    assert metrics["minimum_obstacle_clearance_m"] == pytest.approx(0.14)
    assert metrics["minimum_clearance_m"] == pytest.approx(0.14)
    assert metrics["path_length_m"] == pytest.approx(2.0)
    assert metrics["mean_speed_m_s"] == pytest.approx(0.5)
    assert metrics["top_speed_m_s"] == pytest.approx(0.5)
    assert metrics["jerk_rms_m_s3"] == pytest.approx(0.0, abs=1e-9)
    assert metrics["heading_change_rad_m"] == 0.0
    assert metrics["turn_reversals_per_s"] == 0.0


def test_time_to_contact_on_the_way_to_the_source():
    """At the end its near face, 3.675 - 0.163, is 1.337 m ahead of the front."""
    metrics = run_metrics(straight(source=RESTING))
    ahead = 3.675 - 0.326 / 2 - 2.0 - FRONT
    assert metrics["minimum_time_to_contact_s"] == pytest.approx(ahead / 0.5)
    away = run_metrics(straight(-0.5, source=RESTING))
    assert away["minimum_time_to_contact_s"] is None


def test_time_to_contact_counts_both_motions():
    """Towards each other at 0.5 and 0.3 m/s."""
    cart = {
        "name": "cart",
        "size_m": [0.2, 0.1],
        "waypoints_m": [[8.0, 0.0], [2.0, 0.0]],
        "speed_m_s": 0.3,
    }
    run = straight(obstacles=[cart], source={"waypoints_m": [[0.0, 3.0]]})
    gap = 8.0 - 0.3 * 4.0 - 0.1 - (2.0 + FRONT)
    assert Proximity(run).time_to_contact[-1] == pytest.approx(gap / 0.8)


def test_clearance_between_ticks():
    """A speck at 4 m/s passes the foremost corner, 1 cm off, midway between ticks.

    Turned by 45 deg, that corner lies at (FRONT - SIDE, FRONT + SIDE) / sqrt 2.
    """
    still = np.zeros(40)
    corner = np.array([FRONT - SIDE, FRONT + SIDE]) / math.sqrt(2.0)
    start = corner + np.array([20.5 * 0.1, 0.011])
    speck = {
        "name": "speck",
        "size_m": [0.002, 0.002],
        "waypoints_m": [start.tolist(), [-9.0, float(start[1])]],
        "speed_m_s": 4.0,
    }
    run = motion(still, still, still + math.pi / 4, obstacles=[speck])
    assert np.min(Proximity(run).clearances[0]) > 0.03
    least = run_metrics(run)["minimum_obstacle_clearance_m"]
    assert least == pytest.approx(0.01, abs=2e-4)


def test_time_to_the_goal_and_settling():
    """P enters 1.5 m round the source, leaves, and comes back for good.

    P starts at 0.175 and the goal begins at 3.675 - 1.5 = 2.175: 2 m at 1 m/s.
    """
    there = np.arange(0.0, 2.2, TICK)
    back = np.arange(2.2, 1.8, -TICK)
    x = np.concatenate([there, back, np.arange(1.8, 2.4, TICK)])
    metrics = run_metrics(motion(x, 0 * x, 0 * x, source=RESTING))
    assert metrics["time_to_goal_s"] == pytest.approx(2.0, abs=TICK)
    assert metrics["settling_time_s"] == pytest.approx(2.2 + 0.4 + 0.2, abs=2 * TICK)
    away = run_metrics(straight(0.1, source=RESTING))
    assert away["time_to_goal_s"] is None
    assert away["settling_time_s"] is None


def test_spl_of_a_detour():
    """2 m straight would do; the robot goes two sides of a right triangle."""
    side = np.arange(0.0, math.sqrt(2.0) + 1e-9, math.sqrt(2.0) / 80)
    ones = np.ones(len(side) - 1)
    d = side / math.sqrt(2.0)
    x = np.concatenate([d, d[-1] + d[1:]])
    y = np.concatenate([d, d[-1] * ones - d[1:]])
    run = motion(x, y, 0 * x, cause="reached", source=RESTING)
    metrics = run_metrics(run)
    # From the origin to 1.5 + 0.175 m from the source at 3.675 m.
    assert metrics["shortest_path_m"] == pytest.approx(2.0)
    assert metrics["path_length_m"] == pytest.approx(2.0 * math.sqrt(2.0))
    assert metrics["spl"] == pytest.approx(1.0 / math.sqrt(2.0))
    stuck = run_metrics(motion(x, y, 0 * x, cause="stuck", source=RESTING))
    assert stuck["spl"] == 0.0
    moving = {"waypoints_m": [[3.0, 0.0], [9.0, 0.0]]}
    assert run_metrics(straight(source=moving))["spl"] is None


def test_following_a_moving_source():
    """After 2.5 s: source from 2 m at 0.3 m/s, P from 0.175 m at 0.5 m/s."""
    source = {"waypoints_m": [[2.0, 0.0], [9.0, 0.0]]}
    metrics = run_metrics(straight(source=source))
    time = np.arange(100, 161) * TICK
    error = np.abs(2.0 + 0.3 * time - FRONT - 0.5 * time - 1.2)
    assert metrics["following_error_rms_m"] == pytest.approx(
        math.sqrt(np.mean(error**2))
    )
    assert metrics["following_error_p95_m"] == pytest.approx(np.quantile(error, 0.95))
    assert metrics["following_fraction"] == 1.0
    assert metrics["following_bearing_rms_deg"] == pytest.approx(0.0, abs=1e-9)


def test_swinging_to_and_fro():
    """Heading 0.2 sin(2 pi 0.5 t) over 8 s: eight half-waves of 0.4 rad."""
    time = np.arange(321) * TICK
    theta = 0.2 * np.sin(math.pi * time)
    run = motion(0.5 * time, 0 * time, theta)
    metrics = run_metrics(run)
    assert metrics["turn_reversals_per_s"] == pytest.approx(8 / 8.0)
    assert metrics["heading_change_rad_m"] == pytest.approx(8 * 0.4 / 4.0, rel=0.01)
    # The third derivative's amplitude 0.2 pi^3, over sqrt 2; 1.3 % filtered away.
    rms = 0.2 * math.pi**3 / math.sqrt(2.0)
    assert metrics["angular_jerk_rms_rad_s3"] == pytest.approx(rms, rel=0.03)


def test_a_swing_of_speed_has_its_jerk():
    """v = 0.4 + 0.1 sin(2 pi 0.5 t): jerk 0.1 pi^2, 1.3 % filtered away."""
    time = np.arange(321) * TICK
    v = 0.4 + 0.1 * np.sin(math.pi * time)
    run = motion(0.5 * time, 0 * time, 0 * time, columns={"v_WB_x": v})
    metrics = run_metrics(run)
    largest = 0.1 * math.pi**2
    assert metrics["jerk_max_m_s3"] == pytest.approx(largest, rel=0.02)
    assert metrics["jerk_rms_m_s3"] == pytest.approx(largest / math.sqrt(2.0), rel=0.03)


def test_effort_and_saturation():
    ticks = 81
    flip = np.where(np.arange(ticks) % 2, 1.0, -1.0)
    columns = {
        "attraction_x": np.full(ticks, 3.0),
        "repulsion_x": np.full(ticks, 1.0),
        "repulsion_y": np.full(ticks, 3.0),
        "v_WP_x": np.full(ticks, 0.2),
        "v_WP_y": np.full(ticks, -0.1),
        "wheel_speed_left": 2.0 * flip,
        "wheel_speed_right": np.full(ticks, 12.0),
        "obstacle_speed_1": np.where(np.arange(ticks) < 5, 1.5, 0.1),
    }
    metrics = run_metrics(straight(ticks=ticks, columns=columns))
    assert metrics["control_effort_rms_n"] == pytest.approx(5.0)
    # 1 N x 0.2 m/s - 3 N x 0.1 m/s at 81 ticks.
    assert metrics["push_work_j"] == pytest.approx(-0.1 * 81 * TICK)
    # One wheel's rim changes by 4 rad/s x 0.06 m a tick, the other's never.
    assert metrics["wheel_variation_m_s2"] == pytest.approx(0.5 * 0.24 / TICK)
    assert metrics["saturated_fraction"] == 1.0
    assert metrics["impossible_obstacle_speed_ticks"] == 5


def test_reaction_is_to_the_obstacle_and_not_to_the_source():
    """The push exceeds 0.5 N when P is 0.8 m from the box's near face, 0.95."""
    ticks = 81
    box = {"name": "box", "size_m": [0.1, 0.1], "waypoints_m": [[2.0, 0.0]]}
    x = 0.5 * TICK * np.arange(ticks)
    gap = 1.95 - (x + FRONT)
    columns = {
        "feature_1": np.ones(ticks),
        "collision_1_B_x": gap,
        "repulsion_x": np.where(gap <= 0.9, -1.0, -0.1),
    }
    run = straight(ticks=ticks, obstacles=[box], source=RESTING, columns=columns)
    assert run_metrics(run)["reaction_distance_m"] == pytest.approx(0.9, abs=0.0126)
    columns["collision_1_B_x"] = gap + 0.5  # an echo of something else
    run = straight(ticks=ticks, obstacles=[box], source=RESTING, columns=columns)
    assert run_metrics(run)["reaction_distance_m"] is None


def test_a_run_of_one_tick_has_no_figure_that_is_not_a_number(shortest_run):
    metrics = run_metrics(shortest_run)
    assert metrics["jerk_rms_m_s3"] is None
    assert metrics["sparc"] is None
    assert all(v is None or math.isfinite(v) for v in metrics.values())


def test_figures_of_a_whole_run(crossing_run):
    """Each one applies, and what must be in an interval is."""
    metrics = run_metrics(crossing_run)
    moving_source = {"shortest_path_m", "spl"}
    no_collision = {"contact_warning_s", "contact_unseen_s", "contact_push_n"}
    without = {name for name, value in metrics.items() if value is None}
    assert without == moving_source | no_collision
    value = {name: float(x) for name, x in metrics.items() if x is not None}
    assert value["jerk_max_m_s3"] >= value["jerk_rms_m_s3"]
    assert value["minimum_clearance_m"] <= value["clearance_p05_m"]
    assert value["sparc"] < -1.0
    assert 0.0 <= value["saturated_fraction"] <= 1.0


def collision(x: float, y: float, theta: float, *, ticks: int = 81) -> RunResult:
    """A straight drive from there at 0.5 m/s into a box at (2, 0), with cones."""
    box = {"name": "box", "size_m": [0.1, 0.1], "waypoints_m": [[2.0, 0.0]]}
    s = 0.5 * TICK * np.arange(ticks)
    result = motion(
        x + s * math.cos(theta),
        y + s * math.sin(theta),
        np.full(ticks, theta),
        cause="collision",
        obstacles=[box],
        source={"waypoints_m": [[0.0, 5.0]]},
    )
    array = UltrasonicParameters()
    body = np.array([[2.0, 0.0, 0.0, 0.1, 0.1]])
    for tick, pose in enumerate(result.poses("WB")):
        ranges = cone_ranges(pose, body, array, FRONT)
        echo = ranges <= array.maximum_range_m
        for k in range(3):
            result.columns[f"range_{k + 1}"][tick] = ranges[k] if echo[k] else 3.0
            result.columns[f"echo_{k + 1}"][tick] = echo[k]
    hit = Collision("box", "robot", float(result.time[-1]))
    return replace(result, collision=hit)


def test_a_box_straight_ahead_is_heard_to_the_end():
    metrics = run_metrics(collision(0.0, 0.0, 0.0))
    assert metrics["contact_unseen_s"] == 0.0
    assert metrics["contact_warning_s"] == pytest.approx(2.0)


def test_a_box_before_the_end_of_the_bar_is_lost_from_the_cones():
    """0.35 m aside: the outer cone ends at 45 deg, where the box's far side
    (y - 0.3 from the bar's middle) is nearer than 0.4 m ahead of P."""
    metrics = run_metrics(collision(0.0, -0.35, 0.0, ticks=142))
    # P's x when the corner (2.05, -0.05) of the box leaves at 45 deg: 0.3 aside.
    left = (2.05 - 0.3 - FRONT) / 0.5
    last = 141 * TICK
    assert metrics["contact_unseen_s"] == pytest.approx(last - left, abs=TICK)
    assert metrics["contact_warning_s"] == pytest.approx(last)


def test_a_box_from_behind_was_never_heard_of():
    metrics = run_metrics(collision(4.0, 0.0, 0.0))
    assert metrics["contact_warning_s"] is None
    assert metrics["contact_unseen_s"] is None
    assert metrics["contact_push_n"] == 0.0
