"""Loops of the guarded law, against its own functions in a plain simulation."""

from __future__ import annotations

import math

import numpy as np
import pytest

from analysis.loops.drive_families import (
    DRIVE_LOOPS,
    drive_families,
    drive_poles,
    drive_uncertainty,
)
from analysis.loops.loop_bound import bound_loop
from analysis.loops.loop_margins import loop_margins
from analysis.loops.robustness import pole_cloud
from diagrams import load_scenario
from systems.planning.following import FollowNumbers, left_to_target, wanted_speed
from systems.planning.turning import turn_rate

STEPS = 400


def loops_of(scenario, **values):
    nominal = {p.name: p.nominal for p in drive_uncertainty(scenario)} | values
    box = {name: (value, value) for name, value in nominal.items()}
    families = drive_families(scenario)(box)
    return dict(zip(DRIVE_LOOPS, families, strict=True))


def driven(state, command, lag, period, ticks):
    """States of a robot (x, y, theta, v, w) whose twist follows the command."""
    x, y, theta, v, w = state
    rows, fine = [], period / STEPS
    for _ in range(ticks):
        rows.append((x, y, theta))
        speed, turn = command(rows[-1])
        for _ in range(STEPS):
            v += fine * (speed - v) / lag
            w += fine * (turn - w) / lag
            x += fine * v * math.cos(theta)
            y += fine * v * math.sin(theta)
            theta += fine * w
    return np.array(rows)


def decayed(family, first, ticks):
    """First state of the loop over some ticks, from its value."""
    A = family.matrix_of(np.empty(0))
    state = first * np.eye(len(A))[0]
    return np.array([(np.linalg.matrix_power(A, k) @ state)[0] for k in range(ticks)])


def test_the_distance_shrinks_as_the_law_commands():
    scenario = load_scenario("obstacle_free", ["law=guarded"])
    follow = scenario.follower.attraction
    own, lag = scenario.only.robot, scenario.only.plant.motor_lag_s

    numbers = FollowNumbers(follow.follow_distance_m, own.control_point_m)
    target = 3.0, 0.0
    at = target[0] - follow.follow_distance_m - own.control_point_m - 0.2

    def command(pose):
        return wanted_speed(left_to_target(target, pose, numbers), 0.0), 0.0

    simulated = driven((at, 0.0, 0.0, 0.0, 0.0), command, lag, scenario.tick_s, 60)
    left = 0.2 - (simulated[:, 0] - at)
    expected = decayed(loops_of(scenario)["distance"], 0.2, 60)
    np.testing.assert_allclose(left, expected, atol=2e-4)
    assert abs(expected[-1]) < 0.05


@pytest.mark.parametrize(("name", "speed"), [("obstacle_free", 0.62), ("barn", 1.72)])
def test_the_robot_returns_to_its_way_as_the_law_commands(name, speed):
    scenario = load_scenario(name, ["law=guarded"])
    lag, carrot = scenario.only.plant.motor_lag_s, 1.5

    def command(pose):
        return speed, turn_rate(math.atan2(-pose[1], carrot) - pose[2])

    start = 0.0, 1e-3, 0.0, speed, 0.0
    simulated = driven(start, command, lag, scenario.tick_s, 80)
    family = loops_of(scenario)["across the way"]
    expected = decayed(family, 1e-3, 80)
    np.testing.assert_allclose(simulated[:, 1], expected, atol=2e-6)
    assert abs(expected[-1]) < 6e-4


def test_a_late_tick_and_a_goal_point():
    scenario = load_scenario("barn")
    prompt, late = loops_of(scenario), loops_of(scenario, extra_ticks=1.0)
    for name in DRIVE_LOOPS:
        one, other = (
            loop_margins(each[name].opened.model_of(np.empty(0)))
            for each in (prompt, late)
        )
        # The gain crossover stays; the phase falls by one tick.
        assert other.crossover_rad_s == pytest.approx(one.crossover_rad_s)
        fell = one.delay_margin_s - other.delay_margin_s
        assert fell == pytest.approx(scenario.tick_s)
    # P moves onto a goal point with one gain along and across.
    heading = prompt["heading at the target"].matrix_of(np.empty(0))
    np.testing.assert_array_equal(heading, prompt["distance"].matrix_of(np.empty(0)))


def test_no_corner_is_worse_than_proven():
    scenario = load_scenario("barn")
    box, poles = drive_uncertainty(scenario), drive_poles(scenario)
    cloud = pole_cloud(poles, box, period=scenario.tick_s, samples=20, seed=1)
    bound = bound_loop(drive_families(scenario), cloud)
    found = cloud.worst_growth_per_s
    assert found < bound.proven_growth_per_s < 0.98 * found < 0.0
    worst = loops_of(
        scenario,
        **{p.name: p.high for p in box} | {"carrot_m": 0.5, "wheel_radius_share": 0.98},
    )["across the way"]
    margins = loop_margins(worst.opened.model_of(np.empty(0)))
    for either, value in (
        (bound.disk_margin, margins.disk.alpha),
        (bound.delay_margin_s, margins.delay_margin_s),
    ):
        assert 0.97 * either.found < either.proven < value < 1.1 * either.found
