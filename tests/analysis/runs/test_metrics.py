"""Metrics of motions whose figures can be worked out by hand."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st
from numpy.typing import NDArray

from analysis.runs.measured_run import MeasuredRun
from analysis.runs.metric_table import run_metrics
from analysis.runs.proximity import Proximity
from analysis.runs.smoothness import log_dimensionless_jerk, spectral_arc_length
from diagrams import RunResult, build_sound_follower, load_scenario, simulate
from diagrams.running import referee
from diagrams.running.stop_rules import Collision
from diagrams.scenario.scenario import Scenario
from systems.ranging.parameters import UltrasonicParameters
from systems.ranging.ultrasonic_array import cone_ranges
from systems.world.contacts import contact_time
from systems.world.geometry import rectangle_clearance

TICK = 0.025
#: Half the robot's length: P and its front face.
FRONT = 0.175
#: Half its width.
SIDE = 0.41


@cache
def logged_columns() -> list[str]:
    """All that a run with cones and friction logs."""
    data = {"hearing": "ideal", "plant": {"friction": 0.3}}
    follower = build_sound_follower(Scenario.model_validate(data), log=True)
    return [name for columns in follower.logged.values() for name in columns]


def motion(
    x, y, theta, *, cause: str = "completed", columns: Any = None, **scenario: Any
) -> RunResult:
    """A run with the origin of B at these places, tick by tick; nothing else."""
    settings = Scenario.model_validate({"hearing": "ideal", **scenario})
    time = np.arange(len(x)) * TICK
    source = settings.bodies()["source"].path.poses(time)
    table: dict[str, Any] = {name: np.zeros(len(x)) for name in logged_columns()}
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


@given(seed=st.integers(0, 1000))
def test_bodies_that_are_passed_over_are_not_the_nearest(seed):
    """Clearances and contact times of all bodies at all ticks, one by one."""
    rng = np.random.default_rng(seed)
    ways = np.cumsum(rng.normal(0.0, 0.1, (3, 60)), axis=1)
    boxes = [
        {
            "name": f"box {k}",
            "size_m": rng.uniform(0.05, 1.0, 2).tolist(),
            "waypoints_m": [[3.0 * k - 3.0, 2.5], rng.uniform(-1.0, 1.0, 2).tolist()],
            "speed_m_s": 2.0,
        }
        for k in range(3)
    ]
    run = motion(*ways, obstacles=boxes, source={"waypoints_m": [[0.0, -3.0]]})
    near = Proximity(run)
    velocities = np.gradient(near.bodies[:, :, :2], run.time, axis=1)
    clearances, times = np.empty((2, *near.bodies.shape[:2]))
    for k, i in np.ndindex(clearances.shape):
        clearances[k, i] = rectangle_clearance(near.robot[i], near.bodies[k, i])
        relative = run.vector("v_WB")[:, i] - velocities[k, i]
        times[k, i] = contact_time(near.robot[i], near.bodies[k, i], *relative)
    np.testing.assert_allclose(near.clearance, np.min(clearances, axis=0), atol=1e-12)
    assert np.all(near.least <= np.min(clearances, axis=1) + 1e-12)
    assert near.least_time_to_contact == pytest.approx(np.min(times), rel=1e-9)
    p05 = run_metrics(run)["clearance_p05_m"]
    assert p05 == pytest.approx(np.quantile(near.clearance, 0.05), rel=1e-12)


def test_time_to_contact_counts_both_motions():
    """Toward each other at 0.5 and 0.3 m/s."""
    cart = {
        "name": "cart",
        "size_m": [0.2, 0.1],
        "waypoints_m": [[8.0, 0.0], [2.0, 0.0]],
        "speed_m_s": 0.3,
    }
    run = straight(obstacles=[cart], source={"waypoints_m": [[0.0, 3.0]]})
    gap = 8.0 - 0.3 * (4.0 - 0.15) - 0.1 - (2.0 + FRONT)  # half of v/a to start
    assert Proximity(run).least_time_to_contact == pytest.approx(gap / 0.8)


@pytest.mark.parametrize(("speed", "passed"), [(4.0, 20.5), (7.0, 20.1), (7.0, 20.9)])
def test_clearance_between_ticks(speed, passed):
    """A speck passes the foremost corner, 1 cm off, so many ticks from the start.

    Turned by 45 deg, that corner lies at (FRONT - SIDE, FRONT + SIDE) / sqrt 2. At
    7 m/s the speck is within 0.1 m at one of the two ticks alone.
    """
    still = np.zeros(40)
    corner = np.array([FRONT - SIDE, FRONT + SIDE]) / math.sqrt(2.0)
    start = corner + np.array([passed * speed * TICK, 0.011])
    speck = {
        "name": "speck",
        "size_m": [0.002, 0.002],
        "waypoints_m": [start.tolist(), [-19.0, float(start[1])]],
        "speed_m_s": speed,
        "acceleration_m_s2": 1e6,
    }
    run = motion(still, still, still + math.pi / 4, obstacles=[speck])
    assert np.min(Proximity(run).clearance) > 0.015
    least = run_metrics(run)["minimum_obstacle_clearance_m"]
    assert least == pytest.approx(0.01, abs=2e-4)


@pytest.mark.parametrize(
    ("u", "v", "distance"),
    [(-0.5, 0.5, 0.5), (0.1, -0.4, 0.3), (0.7, 0.05, 0.5), (0.5, -0.5, 0.5), (0, 0, 0)],
)
def test_reaction_distance_is_from_the_turned_box(u, v, distance):
    """P beside a box of 0.4 by 0.2 m at (2, 1) turned by 30 deg, off it, within."""
    turn = math.radians(30.0)
    cos, sin = math.cos(turn), math.sin(turn)
    box = {"size_m": [0.4, 0.2], "waypoints_m": [[2.0, 1.0]], "heading_deg": 30.0}
    run = motion(
        np.full(2, 2.0 + cos * u - sin * v - FRONT),
        np.full(2, 1.0 + sin * u + cos * v),
        np.zeros(2),
        obstacles=[box],
        source={"waypoints_m": [[9.0, 9.0]]},
        columns={
            "repulsion_x": np.full(2, -1.0),
            "feature_1": np.ones(2),
            "collision_1_B_x": np.full(2, distance + 0.19),
        },
    )
    reaction = run_metrics(run)["reaction_distance_m"]
    assert reaction == pytest.approx(distance, abs=1e-9)


def to_and_fro(rest_s: float, **scenario: Any) -> dict[str, float | None]:
    """P enters 1.5 m round the source, leaves, comes back, and stops.

    P starts at 0.175 and the goal begins at 3.675 - 1.5 = 2.175: 2 m at 1 m/s. It
    stops 2.2 + 0.4 + 0.6 s from the start.
    """
    there = np.arange(0.0, 2.2, TICK)
    back = np.arange(2.2, 1.8, -TICK)
    rest = np.full(round(rest_s / TICK), 2.4)
    x = np.concatenate([there, back, np.arange(1.8, 2.4, TICK), rest])
    return run_metrics(motion(x, 0 * x, 0 * x, **scenario))


def test_time_to_the_goal_and_settling():
    metrics = to_and_fro(2.0, source=RESTING)
    assert metrics["time_to_goal_s"] == pytest.approx(2.0, abs=TICK)
    assert metrics["settling_time_s"] == pytest.approx(3.2, abs=2 * TICK)
    assert to_and_fro(0.0, source=RESTING)["settling_time_s"] is None
    assert to_and_fro(0.9, source=RESTING)["settling_time_s"] is None, "a pause"
    away = run_metrics(straight(0.1, source=RESTING))
    assert away["time_to_goal_s"] is None
    assert away["settling_time_s"] is None


@pytest.mark.parametrize(
    ("path_m", "cause", "score", "score_4"),
    [
        # The goal is reached after 2 s. The optimal time is the path at 2 m/s.
        (8.0, "reached", 0.5, 0.25),  # 2 s count as 8 s, or 16 s: 4 s / 8 s
        (1.0, "reached", 0.25, 0.25),  # 0.5 s / 2 s
        (0.6, "reached", 0.15, 0.15),  # 0.3 s / 2 s
        (0.2, "reached", 0.125, 0.125),  # 2 s count as 0.8 s
        (1.0, "collision", 0.0, 0.0),
        (1.0, "stuck", 0.0, 0.0),
    ],
)
def test_scores_in_a_world(path_m, cause, score, score_4):
    x = np.arange(0.0, 2.2, TICK)
    fields = {"source": RESTING, "reference_path_m": path_m}
    metrics = run_metrics(motion(x, 0 * x, 0 * x, cause=cause, **fields))
    assert metrics["mean_time_s"] == pytest.approx(2.0, abs=TICK)
    assert metrics["score"] == pytest.approx(score, rel=0.02)
    assert metrics["score_4"] == pytest.approx(score_4, rel=0.02)
    assert metrics["timeout_fraction"] == (cause == "stuck")
    assert "score" not in run_metrics(straight(source=RESTING))


def test_turning_on_the_spot_is_not_settled():
    """P, 0.175 m ahead of the center, goes 0.07 m/s at 0.4 rad/s, 0.035 at 0.2."""
    still = np.full(161, 2.4)
    time = TICK * np.arange(161)
    for rate, settled in ((0.4, None), (0.2, 0.0)):
        run = motion(still, 0 * still, rate * time - 0.8, source=RESTING)
        assert run_metrics(run)["settling_time_s"] == settled


def test_settling_behind_a_moving_source_is_to_stay_within_the_band():
    """At rest 3.5 m behind, 2 m being the band's end, to 0.5 m/s faster than it."""
    source = {"waypoints_m": [[3.675, 0.0], [9.0, 0.0]], "speed_m_s": 0.1}
    metrics = run_metrics(straight(0.6, source=source))
    assert metrics["time_to_goal_s"] == pytest.approx(1.5 / 0.5, abs=TICK)
    assert metrics["settling_time_s"] == metrics["time_to_goal_s"]


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
    """After 2.5 s: source from 2 m at 0.3 m/s, P from 0.175 m at 0.5 m/s.

    The source's start of 1 m/s^2 costs v^2 / 2a; its drive has 1 mm to settle.
    """
    source = {"waypoints_m": [[2.0, 0.0], [9.0, 0.0]]}
    heard = {"target_valid": np.arange(161) >= 80}
    metrics = run_metrics(straight(source=source, columns=heard))
    time = np.arange(100, 161) * TICK
    error = np.abs(2.0 + 0.3 * time - 0.045 - FRONT - 0.5 * time - 1.2)
    rms, p95 = math.sqrt(np.mean(error**2)), np.quantile(error, 0.95)
    assert metrics["following_error_rms_m"] == pytest.approx(rms, abs=1e-4)
    assert metrics["following_error_p95_m"] == pytest.approx(p95, abs=1e-4)
    assert metrics["following_fraction"] == 1.0
    assert metrics["following_bearing_rms_deg"] == pytest.approx(0.0, abs=1e-9)


def test_the_share_of_following_counts_from_the_first_target_on():
    """P leaves the band, 0.4 m to 2 m, after 3 s; the target comes at 1 s, and goes.

    P from 0.175 m at -0.5 m/s, the source at rest at 0.675 m.
    """
    valid = (np.arange(161) >= 40) & (np.arange(161) < 60)
    run = straight(
        -0.5,
        source={"waypoints_m": [[0.675, 0.0]]},
        start={"position_m": [-3.0, 0.0]},
        columns={"target_valid": valid},
    )
    share = run_metrics(run)["following_fraction"]
    assert share == pytest.approx(81 / 121)
    assert run_metrics(straight())["following_fraction"] is None


def burst_frames(distance: float, **scenario: Any) -> NDArray[np.int64]:
    """Ticks with sound in 41 s, the robot and the source at rest."""
    still = np.zeros(1641)
    source = {"waypoints_m": [[FRONT + distance, 0.0]]}
    run = motion(still, still, still, source=source, **scenario)
    return np.flatnonzero(MeasuredRun(run).frames_with_sound)


@pytest.mark.parametrize("hearing", ["audio", "ideal"])
@pytest.mark.parametrize("distance", [0.5, 4.0, 4.5, 8.0])
def test_frames_with_sound(hearing, distance):
    """20 frames of 25 ms in each of the bursts of 0.5 s in 2 s.

    The last of 21 bursts began at 40 s. The frame [0, 25 ms) ends at tick 1. Of sound
    that is half a frame late, from 12.5 ms x c = 4.3 m on, the first frame holds less
    than half, and one more at the end holds more.
    """
    ticks = burst_frames(distance, hearing=hearing)
    late = int(hearing == "audio" and distance > 4.3)
    first = 1 + late + 80 * np.arange(21)
    np.testing.assert_array_equal(ticks, (first[:, None] + np.arange(20)).ravel())


def test_frames_with_sound_of_other_gates():
    """It begins at 1 s: 20 periods are over, and the 21st begins at the end."""
    sound = {"start_s": 1.0, "on_s": 0.1}
    assert len(burst_frames(1.0, sound=sound)) == 20 * 4
    endless = {"on_s": 2.0}
    assert len(burst_frames(1.0, sound=endless)) == 1640
    assert len(burst_frames(1.0, hearing="ideal_always")) == 1640


@pytest.mark.parametrize("hearing", ["audio", "ideal"])
def test_what_is_heard_and_what_sounds_agree(hearing):
    """A loud source in the free field is heard in every frame that it fills."""
    overrides = ["law=none", f"hearing={hearing}", "duration_s=4.3"]
    result = simulate(load_scenario("default", overrides))
    metrics = run_metrics(result)
    assert metrics["frames_with_sound"] == 20 + 20 + 12
    assert metrics["frames_with_sound_heard"] == metrics["detections"] == 52
    np.testing.assert_array_equal(
        MeasuredRun(result).frames_with_sound, result.columns["detected"] > 0.5
    )


def test_completed_is_decided_by_the_share_that_is_reported(monkeypatch):
    source = "source.waypoints_m=[[1.98, 0], [9, 0]]"
    words = ["hearing=ideal", "law=none", "attraction.stiffness_n_m=0", source]
    scenario = load_scenario("default", [*words, "obstacles=[]", "duration_s=6"])
    share = run_metrics(simulate(scenario))["following_fraction"]
    assert share is not None
    for bound, cause in ((share, "completed"), (share + 1e-6, "astray")):
        monkeypatch.setattr(referee, "FOLLOWING_SHARE", bound)
        assert simulate(scenario).cause == cause


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
    # 1 N x 0.2 m/s - 3 N x 0.1 m/s at 81 ticks, at the first of them from rest.
    assert metrics["push_work_j"] == pytest.approx(-0.1 * 80.5 * TICK)
    # One wheel's rim changes by 4 rad/s x 0.06 m a tick, the other's never.
    assert metrics["wheel_variation_m_s2"] == pytest.approx(0.5 * 0.24 / TICK)
    assert metrics["saturated_fraction"] == 1.0
    assert metrics["impossible_obstacle_speed_ticks"] == 5


def test_saturated_is_a_wheel_or_the_command_at_its_top():
    """12 rad/s on either side, 0.72 m/s; obstacles at twice that are impossible."""
    tick = np.arange(100)
    columns = {
        "wheel_speed_left": np.where(tick < 10, -12.0, 11.9),
        "wheel_speed_right": np.where((tick >= 5) & (tick < 20), 12.0, 0.0),
        "v_WP_x": np.where((tick >= 15) & (tick < 50), 0.432, 0.0),
        "v_WP_y": np.where((tick >= 15) & (tick < 45), -0.576, 0.0),
        "obstacle_speed_2": np.where(tick < 7, 1.45, 1.43),
        "obstacle_speed_3": np.where((tick >= 5) & (tick < 9), 1.45, 0.0),
    }
    metrics = run_metrics(straight(ticks=100, columns=columns))
    assert metrics["saturated_fraction"] == pytest.approx(0.45)
    assert metrics["impossible_obstacle_speed_ticks"] == 9


def test_errors_of_hearing_are_of_fresh_estimates_with_range():
    """Off by 0.1, 0.2, 0.3, 0.48 and 0.6 m; the rest has no range, or is old."""
    tick = np.arange(161)
    off = np.zeros(161)
    # The target goes by an estimate from the tick after it on.
    off[11:16] = [0.6, 0.1, 0.3, 0.48, 0.2]
    columns = {
        "detected": (tick >= 10) & (tick < 20),
        "range_valid": (tick < 15) | (tick > 40),
        "p_WS_estimated_x": 3.675 + 0.6 * off,
        "p_WS_estimated_y": -0.8 * off,
    }
    columns["p_WS_estimated_x"][16:] = 9.0
    metrics = run_metrics(straight(source=RESTING, columns=columns))
    assert (metrics["detections"], metrics["detections_with_range"]) == (10, 5)
    assert metrics["source_error_median_m"] == pytest.approx(0.3)
    # Four fifths of the way from the fourth to the fifth.
    assert metrics["source_error_p95_m"] == pytest.approx(0.576)
    assert metrics["source_outlier_fraction"] == pytest.approx(0.2)


def test_smoothness_is_of_movements_of_4_s_and_not_of_rests():
    """A bell of speed, one of 4 cm/s, two bells, an even drive, and half a bell."""
    time = np.arange(-80, 80) * TICK
    bell = 0.4 * np.exp(-5.0 * time**2)
    pair = 0.4 * (np.exp(-5.0 * (time - 1) ** 2) + np.exp(-5.0 * (time + 1) ** 2))
    even = np.full(160, 0.3)
    speed = np.concatenate([bell, 0.1 * bell, pair, even, bell[:80]])
    x = np.cumsum(speed) * TICK
    metrics = run_metrics(motion(x, 0 * x, 0 * x, columns={"v_WB_x": speed}))
    sparc = [float(spectral_arc_length(v, 40.0)) for v in (bell, pair)]
    ldlj = [float(log_dimensionless_jerk(v, 40.0)) for v in (bell, pair)]
    assert metrics["sparc"] == pytest.approx(sum(sparc) / 2.0)
    assert metrics["ldlj"] == pytest.approx(sum(ldlj) / 2.0)


@pytest.mark.parametrize(("ripple_hz", "counts"), [(7.0, True), (12.0, False)])
def test_ripples_count_up_to_10_hz(ripple_hz, counts):
    """Spectrum of the bell e^(-5 t^2): e^(-pi^2 f^2/5), and 0.15 of it at the ripple's.

    SPARC is the length of that curve up to where it last is at a twentieth.
    """
    time = np.arange(-80, 80) * TICK
    ripple = 1.0 + 0.3 * np.sin(2.0 * math.pi * ripple_hz * time)
    speed = 0.4 * np.exp(-5.0 * time**2) * ripple
    run = motion(np.cumsum(speed) * TICK, 0 * time, 0 * time, columns={"v_WB_x": speed})

    def bell(f):
        return np.exp(-((math.pi * f) ** 2) / 5.0)

    last = math.sqrt(5.0 * math.log(20.0)) / math.pi
    if counts:
        last = ripple_hz + math.sqrt(5.0 * math.log(3.0)) / math.pi
    x = np.linspace(0.0, 1.0, 10_000)
    curve = bell(last * x) + counts * 0.15 * bell(last * x - ripple_hz)
    length = np.sum(np.hypot(np.diff(x), np.diff(curve)))
    assert run_metrics(run)["sparc"] == pytest.approx(-length, rel=0.01)


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
    assert without == moving_source | no_collision | {"slip_way_m"}
    value = {name: float(x) for name, x in metrics.items() if x is not None}
    assert value["jerk_max_m_s3"] >= value["jerk_rms_m_s3"]
    assert value["minimum_clearance_m"] <= value["clearance_p05_m"]
    assert value["sparc"] < -1.0
    assert 0.0 <= value["saturated_fraction"] <= 1.0


def test_odometry_error_is_from_the_true_pose_to_the_believed_one():
    """Off by 3 and 4 parts in 10 of the way: half of it, 0 to 1 m in equal steps."""
    run = straight()
    x = run.columns["p_WB_x"]
    believed = {
        "p_WB_estimated_x": 1.3 * x,
        "p_WB_estimated_y": 0.4 * x,
        "theta_WB_estimated": np.full(len(x), math.radians(5.0)),
    }
    metrics = run_metrics(replace(run, columns=run.columns | believed))
    n = len(x) - 1
    assert metrics["odometry_error_final_m"] == pytest.approx(1.0)
    rms = math.sqrt((2 * n + 1) / (6 * n))
    assert metrics["odometry_error_rms_m"] == pytest.approx(rms)
    assert metrics["odometry_heading_error_rms_deg"] == pytest.approx(5.0)
    assert metrics["slip_way_m"] is None, "wheels that roll have none"


def test_slip_way_is_the_mean_of_both_wheels():
    """At 0.3 and 0.4 m/s on one and 0.4 m/s on the other, for 161 ticks."""
    run = straight(plant={"friction": 0.3})
    slip = {
        "slip_left": np.full(161, -0.3),
        "slip_right": np.zeros(161),
        "slip_sideways": np.full(161, 0.4),
    }
    metrics = run_metrics(replace(run, columns=run.columns | slip))
    assert metrics["slip_way_m"] == pytest.approx((0.5 + 0.4) / 2 * 161 * TICK)


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
    body = np.array([[2.0, 0.0, 0.0, 0.1, 0.1, 0.0]])
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


def test_without_cones_nothing_is_said_of_echoes():
    """A wall across the way, which the law runs into."""
    fields = ["law=trajectory_conventional"]
    result = simulate(load_scenario("unknown_wall", fields), engine="compiled")
    assert result.cause == "collision"
    assert "contact_warning_s" not in run_metrics(result)
