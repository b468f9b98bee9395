"""A cell's figures, of tables small enough to read."""

from __future__ import annotations

import json
import math
from typing import Any

import pandas as pd
import pytest

from analysis.batches.cells import Cell, make_cell

NAN = math.nan


def summarized(fields: dict[str, Any] | None = None, **columns: Any) -> Cell:
    table = {"index": [10 * k for k in range(len(columns["cause"]))], **columns}
    rows = pd.DataFrame({"collision_fault": None, **table})
    return make_cell("here", fields or {"law": "active"}, rows, 1)


def test_fields_of_the_grid_set_a_cell_apart():
    # As a plan's file has them: no string of the code itself.
    fields = json.loads('{"robot.width_m": 0.41, "law": "none", "hearing": "ideal"}')
    cell = summarized(fields, cause=["reached"])
    assert (cell.scenario, cell.fields, cell.runs) == ("here", fields, 1)
    assert cell.label == "width_m 0.41, law none, hearing ideal"


def test_figures_of_successes_leave_out_runs_that_failed_or_have_none():
    """Jerk of runs 0 and 4; clearance of 0, 1, 2 and 4."""
    cell = summarized(
        cause=["completed", "stuck", "collision", "failed", "reached"],
        jerk_rms_m_s3=[2.0, 90.0, 90.0, 90.0, 5.0],
        sparc=[NAN, -9.0, -9.0, -9.0, -2.0],
        ldlj=[NAN, -9.0, -9.0, -9.0, NAN],
        minimum_clearance_m=[0.3, 0.1, -0.1, NAN, 0.2],
    )
    metrics = cell.metrics
    assert set(metrics) == {"jerk_rms_m_s3", "sparc", "minimum_clearance_m"}
    jerk = metrics["jerk_rms_m_s3"]
    # A quarter of the resamples has the lower value twice, a quarter the higher.
    assert (jerk.value, jerk.low, jerk.high, jerk.n) == (3.5, 2.0, 5.0, 2)
    sparc = metrics["sparc"]
    assert (sparc.value, sparc.low, sparc.high, sparc.n) == (-2.0, -2.0, -2.0, 1)
    clearance = metrics["minimum_clearance_m"]
    assert clearance.value == pytest.approx(0.15)
    # The lowest is drawn three or four times of four in 13 of 256 resamples.
    assert (clearance.low, clearance.high, clearance.n) == (-0.1, 0.3, 4)


def test_spl_leaves_out_runs_without_a_shortest_way():
    cell = summarized(cause=["reached"] * 3, spl=[0.5, NAN, 1.0])
    # Two values: each end is drawn twice in a quarter of the resamples.
    spl = cell.metrics["spl"]
    assert (spl.value, spl.low, spl.high, spl.n) == (0.75, 0.5, 1.0, 2)
    assert "spl" not in summarized(cause=["reached"]).metrics
    assert "spl" not in summarized(cause=["reached"], spl=[NAN]).metrics


def test_causes_are_counted_in_the_order_of_their_names():
    cell = summarized(
        cause=["stuck", "collision", "reached", "collision", "stuck", "collision"],
        collision_fault=["robot", "robot", None, "obstacle", None, "robot"],
    )
    assert list(cell.causes.items()) == [
        ("collision (obstacle)", 1),
        ("collision (robot)", 2),
        ("reached", 1),
        ("stuck", 2),
    ]


def test_mechanisms_are_counted_commonest_first():
    """Warned for 0.5 s: late; never: not heard; none of what cannot have cones."""
    cell = summarized(
        cause=["reached", "collision", "lost", "collision", "collision"],
        tick_s=[0.025] * 5,
        contact_warning_s=[NAN, 0.5, NAN, NAN, 0.25],
        contact_unseen_s=[NAN, 0.0, NAN, NAN, 0.0],
        time_to_goal_s=[1.0, NAN, NAN, NAN, NAN],
    )
    assert cell.mechanisms == {"late echo": 2, "lost": 1, "no echo": 1}
    assert next(iter(cell.mechanisms)) == "late echo"
    assert summarized(cause=["collision"]).mechanisms == {}


def test_rates_of_a_cell_are_of_all_its_runs():
    """1 of 4: Wilson's interval 0.0456 to 0.6994 (z = 1.96, from its formula)."""
    cell = summarized(cause=["completed", "collision", "failed", "lost"])
    for rate in (cell.success, cell.collision):
        assert (rate.value, rate.low, rate.high) == pytest.approx(
            (0.25, 0.0456, 0.6994), abs=5e-5
        )


def test_examples_are_failures_first_and_the_middle_is_the_upper_one():
    """Failures 0.4 and 0.5 m clear, successes 0.1 and 0.2: in this order."""
    cell = summarized(
        cause=["reached", "stuck", "completed", "failed", "lost"],
        minimum_clearance_m=[0.2, 0.5, 0.1, NAN, 0.4],
    )
    assert [(e.kind, e.index, e.cause) for e in cell.examples] == [
        ("worst", 40, "lost"),
        ("typical", 20, "completed"),
        ("best", 0, "reached"),
    ]


def test_one_run_is_every_example_and_none_is_no_example():
    cell = summarized(cause=["failed", "stuck"], minimum_clearance_m=[NAN, 0.5])
    assert [e.index for e in cell.examples] == [10, 10, 10]
    assert summarized(cause=["failed"], minimum_clearance_m=[NAN]).examples == ()
    assert summarized(cause=["failed"]).examples == ()
