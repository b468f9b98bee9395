"""Runs that fail, each by another mechanism; docs/results_laws.md explains them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest

from analysis.batches.cells import failure_mechanisms
from analysis.runs.metric_table import run_metrics
from diagrams import RunResult, load_scenario, simulate

pytestmark = pytest.mark.slow

TRAP = "u_trap --law {} --set source.waypoints_m=[[7,0]]"
NO_BOX = (
    "two_static_obstacles --law conventional --set hearing=ideal --set obstacles=[] "
)
RUNS = {
    "out of sight": "two_static_obstacles --law conventional",
    "no echo": "two_moving_obstacles --law conventional",
    "late echo": (
        "one_moving_obstacle --law conventional "
        "--set source.waypoints_m=[[1.6,0],[7,-0.8]] --set obstacles.0.speed_m_s=0.47 "
        "--set obstacles.0.waypoints_m=[[3.45,2.4],[3.05,-3]] "
        "--set obstacles.0.start_time_s=5.0"
    ),
    "jam": (
        "two_static_obstacles --law active --set source.waypoints_m=[[4.5,-0.5]] "
        "--set obstacles.0.waypoints_m=[[1.6,0.37]] "
        "--set obstacles.1.waypoints_m=[[2.95,-0.38]]"
    ),
    "swings": f"{NO_BOX}--set duration_s=20",
    "held off": (
        f"{NO_BOX}--set attraction.follow_distance_m=0.6 "
        "--set attraction.stiffness_n_m=8.4 --set attraction.damping_n_s_m=8.4 "
        "--set laws.conventional.stiffness_n_m=41.9 "
        "--set laws.conventional.damping_n_s_m=6.72"
    ),
    "echo in time": TRAP.format("active"),
}


def run(words: str) -> RunResult:
    """What ``phonotaxis simulate`` would run."""
    scenario, *options = words.split()
    fields = {"--law": "law=", "--velocity-term": "collision_vector.velocity_term="}
    overrides = [
        fields.get(option, "") + value
        for option, value in zip(options[::2], options[1::2], strict=True)
    ]
    return simulate(load_scenario(scenario, overrides), engine="compiled")


def mechanism(result: RunResult, metrics: dict[str, Any]) -> Any:
    tick_s = result.scenario.tick_s
    row = pd.DataFrame([{"cause": result.cause, "tick_s": tick_s, **metrics}])
    columns = {"contact_warning_s": float, "contact_unseen_s": float}
    return failure_mechanisms(row.astype(columns)).iloc[0]


@pytest.mark.parametrize("expected", RUNS)
def test_a_run_fails_by_its_mechanism(expected):
    result = run(RUNS[expected])
    assert mechanism(result, run_metrics(result)) == expected


def test_the_active_push_falls_on_the_way_to_contact():
    """And that of the conventional law grows, to no avail."""
    active, conventional = (run(TRAP.format(law)) for law in ("active", "conventional"))
    for result, grows in ((active, False), (conventional, True)):
        push = np.hypot(result.columns["repulsion_x"], result.columns["repulsion_y"])
        assert (push[-1] > push[-8]) == grows


def test_the_printed_velocity_term_drives_the_robot():
    """Net work of the push, 1.2 J, and ten times less with `closing`."""
    printed, closing = (
        run(f"wall --law conventional --velocity-term {term}")
        for term in ("printed", "closing")
    )
    work = [run_metrics(result)["push_work_j"] or 0.0 for result in (printed, closing)]
    assert work[0] > 0.5
    assert work[1] < 0.2 * work[0]
    assert closing.simulated_s < printed.simulated_s
