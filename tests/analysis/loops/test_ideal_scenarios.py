"""Scenarios with bodies at rest, from scenarios with bodies that keep a schedule."""

from __future__ import annotations

import pytest

from analysis.loops.ideal_scenarios import changed, frozen_scenario
from diagrams import load_scenario


@pytest.mark.parametrize(
    "schedule",
    [
        {"pauses_s": [0.0, 1.0, 0.0]},
        {"waypoint_times_s": [0.0, 4.0, 9.0]},
        {"at_end": "loop"},
    ],
)
def test_bodies_with_a_schedule_rest_where_they_are(schedule):
    cart = {"name": "cart", "waypoints_m": [[4.0, 1.0], [4.0, 2.0], [5.0, 2.0]]}
    scenario = load_scenario("default", {"obstacles": [cart | schedule]})
    (moving,) = scenario.obstacles
    frozen = frozen_scenario(scenario, 2.0)
    (resting,) = frozen.obstacles
    assert resting.path().pose(50.0) == pytest.approx(moving.path().pose(2.0))
    source = {"waypoints_m": [[5.0, 0.0]]}
    timed = load_scenario(
        "default",
        {"source": {"waypoints_m": [[2.0, 0.0], [3.0, 0.0]], "pauses_s": [0.0, 2.0]}},
    )
    assert changed(timed, {"source": source}).source.pauses_s == ()
