"""One run of each kind, with the mechanism that its figures stand for."""

from __future__ import annotations

import math

import pandas as pd
import pytest

from analysis.batches.cells import failure_mechanisms
from analysis.runs.metric_table import run_metrics
from diagrams import load_scenario, simulate

KINDS = [
    ("reached", math.nan, math.nan, None),
    ("completed", math.nan, math.nan, None),
    ("collision", math.nan, math.nan, "no echo"),
    ("collision", 5.0, 0.4, "out of sight"),
    ("collision", 0.5, 0.3, "out of sight"),
    ("collision", 0.5, 0.0, "late echo"),
    ("collision", 5.0, 0.02, "echo in time"),
    # a tick without an echo is none at the tick before the last
    ("collision", 5.0, 0.025, "echo in time"),
    ("collision", 5.0, 0.05, "out of sight"),
    ("collision", 1.0, 0.0, "echo in time"),
    ("collision", 0.975, 0.0, "late echo"),
    ("stuck", math.nan, math.nan, "jam"),
    ("timeout", math.nan, math.nan, "jam"),
    ("unsettled", math.nan, math.nan, "swings"),
    ("astray", math.nan, math.nan, "astray"),
    ("lost", math.nan, math.nan, "lost"),
    ("failed", math.nan, math.nan, "failed"),
]


def test_a_robot_that_came_to_the_goal_is_in_no_jam():
    """It has passed all obstacles: the master robot's own push keeps it off."""
    nothing = {
        "tick_s": 0.025,
        "contact_warning_s": math.nan,
        "contact_unseen_s": math.nan,
    }
    rows = [
        {"cause": "stuck", "time_to_goal_s": 5.0, **nothing},
        {"cause": "stuck", "time_to_goal_s": math.nan, **nothing},
        {"cause": "unsettled", "time_to_goal_s": 5.0, **nothing},
        {"cause": "lost", "time_to_goal_s": 5.0, **nothing},
    ]
    found = failure_mechanisms(pd.DataFrame(rows))
    assert list(found) == ["held off", "jam", "swings", "lost"]


def test_each_kind():
    columns = ["cause", "contact_warning_s", "contact_unseen_s", "mechanism"]
    rows = pd.DataFrame(KINDS, columns=columns)
    found = failure_mechanisms(rows.assign(tick_s=0.025))
    assert [None if pd.isna(x) else x for x in found] == [kind[-1] for kind in KINDS]


@pytest.mark.parametrize("tick_s", [0.01, 0.025, 0.05, 0.1])
def test_a_body_is_out_of_sight_when_it_had_no_echo_at_the_last_tick(tick_s):
    """Whatever the tick: 0, 1, 2 and 3 ticks without an echo."""
    rows = pd.DataFrame(
        {
            "cause": "collision",
            "contact_warning_s": 5.0,
            "contact_unseen_s": [0.0, tick_s, 2 * tick_s, 3 * tick_s],
            "tick_s": tick_s,
        }
    )
    assert failure_mechanisms(rows).tolist() == [
        *["echo in time"] * 2,
        *["out of sight"] * 2,
    ]


@pytest.mark.parametrize(
    ("obstacle", "mechanism"),
    [
        # straight ahead, and no law that pushes
        ("waypoints_m: [[1.6, 0.0]]", "echo in time"),
        # before the left end of the bar: outside of 45 deg from 0.35 m on
        ("waypoints_m: [[1.6, 0.36]]", "out of sight"),
        # from the side, against the bar's end
        ("waypoints_m: [[0.0, 2.0], [0.0, -2.0]], speed_m_s: 3.0", "no echo"),
        # head-on: from the end of the cones, 3 m, in less than a second
        ("waypoints_m: [[6.0, 0.0], [-9.0, 0.0]], speed_m_s: 3.0", "late echo"),
    ],
)
def test_runs_that_fail_so(obstacle, mechanism):
    overrides = [
        "hearing=ideal",
        "law=none",
        "source.waypoints_m=[[4, 0]]",
        f"obstacles=[{{name: box, acceleration_m_s2: 1e6, {obstacle}}}]",
    ]
    result = simulate(load_scenario("default", overrides))
    row = {"cause": result.cause, "tick_s": 0.025, **run_metrics(result)}
    rows = pd.DataFrame([row]).astype({"contact_warning_s": float})
    assert failure_mechanisms(rows).tolist() == [mechanism]
