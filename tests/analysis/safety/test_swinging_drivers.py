"""Drivers that swing: their commands, and the table of long runs."""

from __future__ import annotations

import math

import numpy as np
import pytest

from analysis.safety.driver_trials import SETTINGS, Row, drive_step, run_result, wave
from analysis.safety.long_runs import LongRun, jobs, long_run, summary_table
from analysis.safety.swinging_drivers import (
    BY_HAND,
    draw_swing,
    odometry_error,
    swing_alone,
    swing_at_boxes,
)
from systems.world.geometry import rectangle_clearance


def commanded(
    rows: list[Row], tick: int, pose: tuple[float, float, float]
) -> tuple[float, ...]:
    twist, table = np.zeros(2), np.array(rows, dtype=float).ravel()
    drive_step(tick, None, (np.zeros(3), np.array(pose)), (twist,), (table,))
    return tuple(twist.tolist())


def test_the_swing_by_hand_is_a_cosine_and_a_sine():
    """Shifted in time: the forward speed is a sine, the turn lags by a quarter."""
    for tick in range(100):
        t = 0.025 * tick
        row = BY_HAND.until(1e3)._replace(rate=20.0 * 0.025)
        v, omega = commanded([row], tick, (0.0, 0.0, 0.0))
        assert v == pytest.approx(0.72 * math.sin(20.0 * t), abs=1e-12)
        assert omega == pytest.approx(-3.5 * math.cos(20.0 * t), abs=1e-12)


def test_waves_are_sines_that_become_squares_and_sawteeth():
    angle = np.linspace(0.0, math.tau, 721)
    sine, square, saw = (
        np.array([wave(a, edge, skew) for a in angle])
        for edge, skew in ((1.0, 0.0), (50.0, 0.0), (1.0, 1.0))
    )
    assert np.allclose(sine, np.sin(angle))
    assert np.allclose(np.abs(square[5:355]), 1.0)
    assert np.ptp(square) == 2.0
    # A sawtooth has a steep flank.
    assert np.abs(np.diff(saw)).max() > 1.5 * np.abs(np.diff(sine)).max()


def test_a_corner_is_turned_to_a_goal_by_the_true_pose():
    """The goal has to be at the bearing 1 rad; the estimated pose plays no part."""
    row = Row(1e3, mode=3, omega=1.0, x=2.0, y=2.0, by_truth=1.0)
    heading = 0.25 * math.pi - 1.0
    assert commanded([row], 0, (1.0, 1.0, heading)) == pytest.approx((0.0, 0.0))
    v, omega = commanded([row], 0, (1.0, 1.0, heading - 0.1))
    assert v == 0.0
    assert omega == pytest.approx(0.4)


@pytest.mark.slow
def test_a_swinging_driver_visits_a_box_and_comes_back_to_it():
    """It comes near the box twice and turns corners of the body toward it."""
    box = 0.0, -1.63, 0.0, 0.3, 0.3
    names = "box", "swing", "plain"
    result = run_result(swing_at_boxes(names, [box], BY_HAND, 60.0, swings=1))
    robot, near, aimed = result.scenario.only.robot, [], []
    body = np.array([0.0, 0.0, 0.0, robot.length_m, robot.width_m, 0.0])
    corner = math.atan2(robot.width_m, robot.length_m)
    for x, y, theta in result.poses("WB"):
        body[:3] = x, y, theta
        near.append(rectangle_clearance(body, np.array([*box, 0.0])) < 0.15)
        off = math.atan2(-1.48 - y, -x) - theta
        off = (off + math.pi) % math.tau - math.pi
        aimed.append(near[-1] and abs(abs(off) - corner) < 0.05)
    assert np.count_nonzero(np.diff(near) > 0) >= 2
    times = result.time[aimed]
    assert np.ptp(times) > 15.0
    assert len(times) > 40


def test_swings_are_drawn_at_all_frequencies():
    draw = np.random.default_rng(5)
    swings = np.array([draw_swing(draw) for _ in range(500)])
    hz = swings[:, 2]
    assert hz.min() < 0.13
    assert hz.max() > 8.0
    assert (np.abs(swings[:, 0]) <= 0.72).all()


@pytest.mark.slow
def test_a_long_run_is_judged_by_the_true_path():
    """The odometry does not know that the wheels differ by one percent."""
    trial = swing_alone(BY_HAND._replace(hz=0.2), "slip apart", 20.0)
    run, result = long_run(trial, BY_HAND), run_result(trial)
    assert run.simulated_s == pytest.approx(20.0)
    assert run.odometry_m == odometry_error(result).max() > 0.001
    assert not math.isfinite(run.contact_s)


def test_the_table_counts_runs_hours_and_contacts():
    runs = [
        LongRun("a", "plain", 1800.0, math.inf, 0.05, 0.001, None),
        LongRun("a", "plain", 900.0, 900.0, -0.002, 0.07, BY_HAND),
        LongRun("b", "plain", 3600.0, math.inf, 0.03, 0.002, None),
    ]
    lines = [line.split("|") for line in summary_table(runs, ("driver",)).splitlines()]
    cells = [[text.strip() for text in line[1:-1]] for line in lines[2:]]
    assert cells == [
        ["a", "2", "0.8", "1", "900", "-2.0", "70.0"],
        ["b", "1", "1.0", "0", "", "30.0", "2.0"],
        ["all", "3", "1.8", "1", "900", "-2.0", "70.0"],
    ]


def test_the_jobs_cover_every_setting():
    taken = {each.args[0] for each in jobs(1)}
    assert taken == set(SETTINGS)
