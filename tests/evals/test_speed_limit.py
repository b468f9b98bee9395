"""How often the active law's velocity term is off in experiment 2, by top speed."""

from __future__ import annotations

import numpy as np
import pytest

from diagrams import load_scenario, simulate
from tests.results import documented, numbers

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(("column", "top_speed"), [(1, 0.6), (2, 0.72)])
def test_share_of_ticks_at_or_above_mu_0(column, top_speed):
    """Of the ticks before the goal in which s is known."""
    setting = f"robot.top_speed_m_s={top_speed}"
    scenario = load_scenario("two_static_obstacles", [setting])
    result = simulate(scenario, engine="compiled")
    s = result.columns["obstacle_speed_1"]
    inside = result.columns["source_range_true"] <= result.scenario.goal_radius_m
    known = (s > 0.0) & ~np.maximum.accumulate(inside)
    row = documented("mu_0", "fast ticks")[0]
    share, count = numbers(row[column])
    assert known.sum() == pytest.approx(count, abs=3)
    assert (s[known] >= 0.6).mean() == pytest.approx(share / 100, abs=0.015)


def test_robot_of_experiment_2_is_no_faster_than_mu_0():
    """Han 5.2: the maximum approaching velocity of the mobile robot, 600 mm/s."""
    for law in ("conventional", "active", "conventional2017", "active2017"):
        scenario = load_scenario("two_static_obstacles", [f"law={law}"])
        assert scenario.only.robot.top_speed_m_s == 0.6
        assert scenario.follower.laws.active.speed_limit_m_s == 0.6
    assert load_scenario("one_moving_obstacle").only.robot.top_speed_m_s == 0.72
