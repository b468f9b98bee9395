"""A sweep of several robots has each one's end and figures, by its name."""

from __future__ import annotations

import pytest

from analysis.batches.batch import summarize
from analysis.batches.plan import SweepPlan
from analysis.batches.report import robot_rows
from analysis.batches.sweep import prepare_sweep
from diagrams import load_scenario, simulate


@pytest.mark.usefixtures("no_workers")
def test_rows_and_pages_have_each_robots_own(tmp_path):
    """Head on and nothing to avoid with: both touch, each the other."""
    settings = {
        "hearing": "ideal",
        "duration_s": 6.0,
        "law": "none",
        "robots.near.start.position_m": [0.0, 0.0],
        "robots.near.follows": "east",
        "robots.far.start.position_m": [3.0, 0.0],
        "robots.far.start.heading_deg": 180.0,
        "robots.far.follows": "west",
        "robots.far.attraction.follow_distance_m": 1.2,
        "sources": {
            "east": {"waypoints_m": [[6.0, 0.0]], "body": True},
            "west": {"waypoints_m": [[-3.0, 0.0]], "body": True},
        },
    }
    plan = SweepPlan.model_validate({"scenario": "two_followers", "set": settings})
    table = prepare_sweep(plan, tmp_path / "out", workers=1).run()
    row = table.iloc[0]
    assert row["cause"] == row["near.cause"] == row["far.cause"] == "collision"
    assert (row["near.collision_object"], row["far.collision_object"]) == (
        "far",
        "near",
    )
    head, near, far = robot_rows(summarize(plan, table, "two_followers"))
    assert (near[1], far[1]) == ("near", "far")
    assert head[2:4] == ["least clearance (m)", "least clearance from obstacles (m)"]
    assert near[2] == far[2], "each touches the other"
    whole = simulate(load_scenario(tmp_path / "out" / "scenario.yaml"))
    touched = whole.robots["far"].collision
    assert touched is not None
    assert row["collision_time_s"] == pytest.approx(touched.time)
