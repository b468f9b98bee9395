from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from analysis.batches.batch import Batch, summarize
from analysis.batches.cells import Quantity, cell_label, marginal
from analysis.batches.page import batch_page
from analysis.batches.plan import SweepPlan
from analysis.batches.report import batch_document, batch_text

SUCCESS, COLLISION = Quantity("success"), Quantity("collision")
CLEARANCE = Quantity("minimum_clearance_m")
SPEED, X = "source.speed_m_s", "obstacles.0.waypoints_m"
PLACES = [[[2.0, 1.0]], [[3.0, 1.0]]]
BOXES = {"count": [1, 2], "x_m": [2.0, 3.0], "y_m": [1.0, 2.0], "side_m": [0.1, 0.2]}


def made_up(**changes):
    """A plan, its points and results in which clearance is twice the speed."""
    plan = SweepPlan.model_validate(
        {
            "grid": {"law": ["none", "active"], "duration_s": [10.0, 20.0, 30.0]},
            "draw": {SPEED: {"uniform": [0.1, 0.5]}, X: {"choice": PLACES}},
            "runs": 40,
            **changes,
        }
    )
    points = plan.points()
    table = pd.DataFrame(
        {
            "index": [point.index for point in points],
            "cell": [point.cell for point in points],
            "run": [point.run for point in points],
            "seed": [point.seed for point in points],
            "redraws": 0,
            "law": [point.fields.get("law", "none") for point in points],
            SPEED: [point.fields[SPEED] for point in points],
            X: [str(point.fields.get(X)) for point in points],
            "cause": "completed",
            "collision_object": None,
            "collision_fault": None,
            "minimum_clearance_m": [2.0 * point.fields[SPEED] for point in points],
            "simulated_s": 10.0,
            "wall_s": 0.1,
            "error": None,
            "engine": "drake",
        }
    )
    active = (table["law"] == "active") & (table["run"] < 10)
    table.loc[active, ["cause", "collision_object", "collision_fault"]] = [
        "collision",
        "box",
        "robot",
    ]
    failed = table["index"] == 0
    table.loc[failed, "cause"] = "failed"
    table.loc[failed, "minimum_clearance_m"] = np.nan
    table.loc[failed, "error"] = "ValueError: <broken>"
    return plan, points, table


def batch(plan, points, table, out) -> Batch:
    """A batch whose runs are done."""
    done: Any = SimpleNamespace(points=points, store=SimpleNamespace(out=out))
    summary = summarize(plan, table.assign(warnings="[]"), "default")
    return Batch("Sweep", out, {"default": done}, {"default": summary}, [])


def test_an_error_is_a_run_without_success_and_without_collision():
    _, _, table = made_up()
    rate = COLLISION.estimate(table)
    assert (rate.value, rate.n) == (30 / 240, 240)
    reference = stats.binomtest(30, 240).proportion_ci(method="wilson")
    assert rate.ends == pytest.approx((reference.low, reference.high))
    assert SUCCESS.estimate(table).value == 209 / 240


def test_medians_leave_out_missing_values():
    values = [3.0, np.nan, 1.0, 2.0]
    runs = pd.DataFrame({"cause": "reached", "time": values})
    estimate = Quantity("time").estimate(runs)
    assert (estimate.value, *estimate.ends, estimate.n) == (2.0, 1.0, 3.0, 3)
    assert Quantity("x").estimate(runs).n == 0
    assert SUCCESS.estimate(runs.iloc[:0]).n == 0
    assert SUCCESS.text(SUCCESS.estimate(runs)) == "100 (51, 100)"
    assert SUCCESS.text(SUCCESS.estimate(runs.iloc[:0])) == "-"


def test_a_metric_counts_the_runs_of_its_record():
    """Jerk is of successful runs and clearance is of all, in whatever batch."""
    runs = pd.DataFrame(
        {
            "cause": ["reached", "collision", "completed", "stuck", "failed"],
            "jerk_rms_m_s3": [1.0, 9.0, 2.0, 8.0, np.nan],
            "near.jerk_rms_m_s3": [1.0, 9.0, 2.0, 8.0, np.nan],
            "minimum_clearance_m": [0.3, -0.1, 0.5, 0.1, np.nan],
        }
    )
    for name in ("jerk_rms_m_s3", "near.jerk_rms_m_s3"):
        estimate = Quantity(name).estimate(runs)
        assert (estimate.value, estimate.n) == (1.5, 2)
    estimate = CLEARANCE.estimate(runs)
    assert (estimate.value, estimate.n) == (0.2, 4)


def test_marginal_of_a_number_follows_it():
    plan, _, table = made_up()
    found = marginal(plan, SPEED, table, CLEARANCE)
    assert len(found.places) == 8
    medians = [estimate.value for estimate in found.estimates]
    np.testing.assert_allclose(medians, 2.0 * found.places)
    assert np.all(np.diff(found.places) > 0.0)


def test_marginal_of_a_choice_has_its_values():
    plan, _, table = made_up()
    found = marginal(plan, X, table, SUCCESS)
    assert found.labels == ("[[2.0, 1.0]]", "[[3.0, 1.0]]")
    for label, estimate in zip(found.labels, found.estimates, strict=True):
        runs = table[table[X] == label]
        assert estimate.value == (runs["cause"] == "completed").mean()


def test_labels_are_short():
    assert cell_label({"repulsion.term": "printed", "a.b": [1, 2]}) == (
        "term printed, b [1, 2]"
    )
    assert cell_label({}) == "all runs"


def test_summary_counts_and_names_failures(tmp_path):
    plan, points, table = made_up()
    found = batch(plan, points, table, tmp_path)
    summary = batch_document(found)
    assert (summary["runs"], summary["failed"]) == (240, 1)
    causes = [cell["causes"] for cell in summary["cells"]]
    assert causes == [
        {"completed": 39, "failed": 1},
        {"completed": 40},
        {"completed": 40},
        *[{"completed": 30, "collision (robot)": 10}] * 3,
    ]
    (failure,) = summary["failures"]
    assert failure["seed"] == points[0].seed
    assert f"--seed {points[0].seed}" in failure["command"]
    metrics = summary["cells"][0]["metrics"]
    assert set(metrics) == {"minimum_clearance_m", "simulated_s"}
    assert "1 of 240 runs failed" in batch_text(found, summary)


@pytest.mark.parametrize(
    ("changes", "figures"),
    [
        ({}, 3),
        ({"grid": {"law": ["none", "active"]}}, 3),
        ({"grid": {}}, 2),
        ({"grid": {"law": ["none", "active"], "duration_s": [1, 2],
                   "attraction.stiffness_n_m": [1, 2, 3]}}, 4),
        # Lists of boxes are all different: there is nothing to plot over.
        ({"draw": {SPEED: {"uniform": [0.1, 0.5]}, "obstacles": {"boxes": BOXES}}}, 2),
    ],
)  # fmt: skip
def test_page_has_a_figure_for_each_field(tmp_path, changes, figures):
    plan, points, table = made_up(**changes)
    found = batch(plan, points, table, tmp_path)
    page = batch_page(found, batch_document(found))
    assert page.count("<figure") == figures
    assert "ValueError: &lt;broken&gt;" in page
    assert "<broken>" not in page
