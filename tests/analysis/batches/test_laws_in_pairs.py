"""Summaries of tables whose figures are written down here."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pandas as pd
import pytest

from analysis.batches.batch import Summary, summarize
from analysis.batches.pairs import pooled_pairs
from analysis.batches.plan import SweepPlan

#: Cause and clearance of each law's runs, layout by layout.
RUNS: dict[str, list[tuple[str, float]]] = {
    "conventional": [
        ("collision", -0.01),
        ("collision", -0.02),
        ("reached", 0.10),
        ("stuck", 0.20),
        ("reached", 0.30),
    ],
    "active": [
        ("reached", 0.05),
        ("collision", -0.01),
        ("reached", 0.15),
        ("reached", 0.25),
        ("failed", math.nan),
    ],
}


def table() -> pd.DataFrame:
    rows: list[dict[str, Any]] = [
        {
            "index": 2 * run + cell,
            "cell": cell,
            "run": run,
            "cause": cause,
            "collision_fault": "robot" if cause == "collision" else None,
            "minimum_clearance_m": clearance,
            "minimum_obstacle_clearance_m": clearance,
            "jerk_rms_m_s3": 1.0 + cell + run,
            "spl": 0.8 if cause == "reached" else 0.0,
        }
        for cell, law in enumerate(RUNS)
        for run, (cause, clearance) in enumerate(RUNS[law])
    ]
    return pd.DataFrame(rows).sort_values("index")


@pytest.fixture(scope="module")
def comparison() -> Summary:
    plan = SweepPlan(grid={"law": tuple(RUNS)}, runs=5)
    return summarize(plan, table(), "here")


def test_rates_of_each_law(comparison):
    conventional, active = comparison.cells
    assert conventional.success.value == pytest.approx(2 / 5)
    assert conventional.collision.value == pytest.approx(2 / 5)
    assert active.success.value == pytest.approx(3 / 5)
    assert active.collision.value == pytest.approx(1 / 5)
    # Wilson's interval of 2 in 5, worked out from its formula.
    z, n, p = 1.959964, 5, 0.4
    center = (p + z * z / (2 * n)) / (1 + z * z / n)
    half = z / (1 + z * z / n) * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    assert conventional.success.low == pytest.approx(center - half, abs=1e-6)
    assert conventional.success.high == pytest.approx(center + half, abs=1e-6)


def test_causes_say_whose_fault(comparison):
    assert comparison.cells[0].causes == {
        "collision (robot)": 2,
        "reached": 2,
        "stuck": 1,
    }
    assert comparison.cells[1].causes["failed"] == 1


def test_clearance_is_of_all_runs_and_jerk_of_successful_ones(comparison):
    conventional, active = (cell.metrics for cell in comparison.cells)
    assert conventional["minimum_obstacle_clearance_m"].value == pytest.approx(0.1)
    assert conventional["minimum_obstacle_clearance_m"].n == 5
    assert conventional["jerk_rms_m_s3"].value == pytest.approx((3.0 + 5.0) / 2)
    assert conventional["jerk_rms_m_s3"].n == 2
    assert active["minimum_obstacle_clearance_m"].n == 4
    assert "sparc" not in active


def test_spl_is_the_mean_of_its_terms(comparison):
    assert comparison.cells[0].metrics["spl"].value == pytest.approx(0.8 * 2 / 5)


def test_pairs_are_of_the_same_layout(comparison):
    (pair,) = comparison.pairs
    assert (pair.first, pair.second, pair.field) == ("conventional", "active", "law")
    assert (pair.success.only_first, pair.success.only_second) == (1, 2)
    assert (pair.collision.only_first, pair.collision.only_second) == (1, 0)
    jerk = pair.metrics["jerk_rms_m_s3"]
    assert (jerk.difference.n, jerk.difference.value) == (1, -1.0)
    clearance = pair.metrics["minimum_obstacle_clearance_m"]
    assert clearance.difference.n == 4
    assert clearance.difference.value == pytest.approx((-0.05 - 0.05) / 2)


def test_examples_are_ordered_by_success_then_by_clearance(comparison):
    kinds = [example.kind for example in comparison.cells[0].examples]
    assert kinds == ["worst", "typical", "best"]
    runs = [example.index // 2 for example in comparison.cells[0].examples]
    assert runs == [1, 3, 4]
    # The run that raised an error is not among them.
    assert [e.index // 2 for e in comparison.cells[1].examples] == [1, 2, 3]


def test_pooled_pairs_are_those_of_all_experiments():
    """The same table twice: counts double, rates and medians stay."""
    plan = SweepPlan(grid={"law": tuple(RUNS)}, runs=5)
    (once,) = summarize(plan, table(), "here").pairs
    (twice,) = pooled_pairs([(plan, table()), (plan, table())])
    assert twice.success.difference.n == 2 * once.success.difference.n
    assert twice.success.only_second == 2 * once.success.only_second
    assert twice.success.difference.value == once.success.difference.value
    name = "minimum_obstacle_clearance_m"
    assert twice.metrics[name].difference.value == once.metrics[name].difference.value
    assert twice.metrics[name].difference.n == 8


def test_one_experiment_pooled_is_itself():
    plan = SweepPlan(grid={"law": tuple(RUNS)}, runs=5)
    pairs = summarize(plan, table(), "here").pairs
    expected = [replace(pair, scenario="all", fields={}) for pair in pairs]
    assert pooled_pairs([(plan, table())]) == expected


def test_pairs_differ_in_one_field_alone():
    grid = {"law": ("none", "active"), "hearing": ("audio", "ideal")}
    plan = SweepPlan(grid=grid, runs=1)
    rows = pd.DataFrame(
        {
            "index": range(4),
            "cell": range(4),
            "run": 0,
            "cause": "reached",
            "collision_fault": None,
        }
    )
    pairs = summarize(plan, rows, "here").pairs
    assert [(p.field, p.first, p.second, p.fields) for p in pairs] == [
        ("hearing", "audio", "ideal", {"law": "none"}),
        ("law", "none", "active", {"hearing": "audio"}),
        ("law", "none", "active", {"hearing": "ideal"}),
        ("hearing", "audio", "ideal", {"law": "active"}),
    ]


def test_pooled_pairs_join_cells_that_differ_in_the_same_values():
    """Two experiments, each with two pairs of laws and two of hearings, of 1 run."""
    grid = {"law": ("none", "active"), "hearing": ("audio", "ideal")}
    plan = SweepPlan(grid=grid, runs=1)
    causes = ["reached", "collision", "reached", "reached"]
    rows = pd.DataFrame(
        {
            "index": range(4),
            "cell": range(4),
            "run": 0,
            "cause": causes,
            "collision_fault": None,
        }
    )
    found = {pair.field: pair for pair in pooled_pairs([(plan, rows), (plan, rows)])}
    assert set(found) == {"law", "hearing"}
    for field, first, second in (("law", 0, 2), ("hearing", 2, 0)):
        pair = found[field]
        assert (pair.scenario, pair.fields, pair.success.difference.n) == ("all", {}, 4)
        assert (pair.success.only_first, pair.success.only_second) == (first, second)
        assert (pair.collision.only_first, pair.collision.only_second) == (
            second,
            first,
        )


#: Fields of a scenario with another tick.
PERIODS = ("tick_s", "microphones.frame_s", "ultrasonic.period_s")


@pytest.mark.parametrize(
    ("plan", "swept", "out_of_sight"),
    [
        ({}, {}, 5),  # 0.06 s without an echo are two ticks and more of 25 ms
        ({"set": dict.fromkeys(PERIODS, 0.05)}, {}, 0),  # one tick and more of 50 ms
        ({}, {"tick_s": 0.05}, 0),  # as a field of a grid or a draw
    ],
)
def test_mechanisms_go_by_the_tick_of_the_runs(plan, swept, out_of_sight):
    rows = table().assign(
        cause="collision",
        contact_warning_s=5.0,
        contact_unseen_s=0.06,
        **swept,
    )
    plan = SweepPlan(grid={"law": tuple(RUNS)}, runs=5, **plan)
    for cell in summarize(plan, rows, "here").cells:
        assert cell.mechanisms.get("out of sight", 0) == out_of_sight


def test_encounters_are_of_layouts_on_which_both_pushed():
    """Both succeed on layouts 2 and 3 of these; only on 3 do both push."""
    rows = table()
    rows.loc[rows["run"] >= 2, "cause"] = "reached"
    rows["reaction_distance_m"] = [
        1.0 if (run, cell) in {(2, 0), (3, 0), (3, 1)} else math.nan
        for run, cell in zip(rows["run"], rows["cell"], strict=True)
    ]
    plan = SweepPlan(grid={"law": tuple(RUNS)}, runs=5)
    (pair,) = summarize(plan, rows, "here").pairs
    assert pair.metrics["jerk_rms_m_s3"].difference.n == 3
    assert pair.encounters["jerk_rms_m_s3"].difference.n == 1
    assert pair.encounters["jerk_rms_m_s3"].first == 1.0 + 3
    assert "minimum_clearance_m" not in pair.encounters
