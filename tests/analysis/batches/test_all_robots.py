"""Figures of several robots together, and comparisons of them."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from analysis.batches.batch import summarize
from analysis.batches.comparison_plans import comparison_plan
from analysis.batches.one_run import Task, results_table, run_task
from analysis.batches.run_rows import with_all_robots
from systems.framework.input_error import InputError
from systems.laws.catalog import ROUTE_LAWS


def test_worst_last_and_mean():
    table = pd.DataFrame(
        {
            "a.minimum_clearance_m": [0.3, 0.1],
            "b.minimum_clearance_m": [0.2, np.nan],
            "a.time_to_goal_s": [10.0, 11.0],
            "b.time_to_goal_s": [14.0, 9.0],
            "a.route_deviation_max_m": [0.5, 0.2],
            "b.route_deviation_max_m": [0.4, 0.9],
            "a.path_length_m": [6.0, 7.0],
            "b.path_length_m": [8.0, 7.0],
        }
    )
    pooled = with_all_robots(table, ["a", "b"])
    assert pooled["minimum_clearance_m"].tolist()[0] == 0.2
    assert np.isnan(pooled["minimum_clearance_m"][1])
    assert pooled["time_to_goal_s"].tolist() == [14.0, 11.0]
    assert pooled["route_deviation_max_m"].tolist() == [0.5, 0.9]
    assert pooled["path_length_m"].tolist() == [7.0, 7.0]
    assert with_all_robots(table, ["robot"]) is table


def test_two_robots_are_compared():
    """All of them drive by the law; what they did together is in the cells."""
    laws = "trajectory_adaptive", "trajectory_filtered"
    plan = comparison_plan("robots_2", laws=laws, runs=3)
    tasks = [
        Task(point, plan.scenario_of(point), "compiled", trajectory=False)
        for point in plan.points()
    ]
    table = results_table(run_task(task).row for task in tasks)
    comparison = summarize(plan, table, "robots_2")
    _, filtered = comparison.cells
    assert filtered.causes == {"reached": 3}
    each = [f"{name}.minimum_obstacle_clearance_m" for name in ("first", "second")]
    rows = table[table["law"] == laws[1]]
    least = np.median(rows[each].min(axis=1))
    assert filtered.metrics["minimum_obstacle_clearance_m"].value == least > 0.0
    assert len(comparison.pairs) == 1
    # What sees bodies, not echoes, has nothing to say of mechanisms.
    assert not any(cell.mechanisms for cell in comparison.cells)


def test_laws_are_those_for_routes_where_there_are_routes():
    plan = comparison_plan("robots_2")
    assert set(plan.grid["law"]) <= set(ROUTE_LAWS)
    assert set(comparison_plan("corridor").grid["law"]).isdisjoint(ROUTE_LAWS)


def test_a_robot_with_a_law_of_its_own_is_refused(tmp_path):
    path = tmp_path / "two.yaml"
    path.write_text(
        "robots: {a: {law: none}, b: {start: {position_m: [0, 3]}}}\nhearing: ideal\n",
        encoding="utf-8",
    )
    with pytest.raises(InputError, match=r"robots.a.law: is 'none', but a comparison"):
        comparison_plan(str(path))
