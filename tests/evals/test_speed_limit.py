"""How often the active law's velocity term is off in experiment 2, by top speed."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from diagrams import load_scenario, simulate

pytestmark = pytest.mark.slow

PAGE = (Path(__file__).parents[2] / "docs" / "laws.md").read_text("utf-8")


@pytest.mark.parametrize(("column", "top_speed"), [(0, 0.6), (1, 0.72)])
def test_share_of_ticks_at_or_above_mu_0(column, top_speed):
    """Of the ticks before the goal in which s is known: the row of docs/laws.md."""
    setting = f"robot.top_speed_m_s={top_speed}"
    result = simulate(load_scenario("two_static_obstacles", [setting]))
    s = result.columns["obstacle_speed_1"]
    inside = result.columns["source_range_true"] <= result.scenario.goal_radius_m
    known = (s > 0.0) & ~np.maximum.accumulate(inside)
    row = re.search(r"(?m)^\| the library's layout \|(.*)\|$", PAGE)
    assert row is not None
    share, count = re.findall(r"\d+", row[1].split("|")[column])
    assert known.sum() == pytest.approx(int(count), abs=3)
    assert (s[known] >= 0.6).mean() == pytest.approx(int(share) / 100, abs=0.015)


def test_robot_of_experiment_2_is_no_faster_than_mu_0():
    """Han 5.2: the maximum approaching velocity of the mobile robot, 600 mm/s."""
    for law in ("conventional", "active", "conventional2017", "active2017"):
        scenario = load_scenario("two_static_obstacles", [f"law={law}"])
        assert scenario.robot.top_speed_m_s == 0.6
        assert scenario.repulsion.active.speed_limit_m_s == 0.6
    assert load_scenario("one_moving_obstacle").robot.top_speed_m_s == 0.72
