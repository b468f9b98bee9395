"""The closed loop in a room that reverberates, with colored ego noise."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.runs.metric_table import run_metrics
from diagrams import load_scenario, simulate
from studies.following_in_rooms import (
    BURST_ENDS_S,
    behind,
    in_a_room,
    on_the_right_side,
    write_ego_noise,
)

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def room(tmp_path_factory) -> list[str]:
    return in_a_room(write_ego_noise(tmp_path_factory.mktemp("noise")))


def test_the_robot_follows_as_in_the_free_field(room):
    """One seed; docs/results_hearing.md has more."""
    shares = []
    empty: list[str] = []
    for overrides in (empty, room):
        scenario = load_scenario("obstacle_free", overrides)
        result = simulate(scenario, engine="compiled")
        assert result.cause == "completed"
        shares.append(float(run_metrics(result)["following_fraction"] or 0.0))
    free, reverberant = shares
    assert reverberant > free - 0.05


def test_a_source_behind_is_found_within_two_bursts(room):
    """38 of 40 starts in the table; these are its first ten."""
    right = []
    for seed in range(10):
        overrides = ["obstacles=[]", f"duration_s={BURST_ENDS_S[1]}", *behind(seed)]
        scenario = load_scenario("default", [*overrides, *room])
        result = simulate(scenario, engine="compiled")
        right.append(on_the_right_side(result)[-1])
    assert np.count_nonzero(right) >= 9
