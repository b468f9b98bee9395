"""Baselines in whole runs: both engines, and what their sources lead one to expect."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.batches.comparison_plans import comparison_plan
from diagrams import simulate

pytestmark = pytest.mark.slow

#: Not the seed with which their settings were chosen.
SEED, LAYOUTS = 2026, 10


def runs(name, law):
    settings = {"hearing": "ideal"}
    plan = comparison_plan(name, laws=[law], runs=LAYOUTS, seed=SEED, settings=settings)
    scenarios = [plan.scenario_of(point) for point in plan.points()]
    ended = [simulate(scenario, engine="compiled") for scenario in scenarios]
    assert_same(simulate(scenarios[0], engine="drake"), ended[0])
    return ended


def assert_same(drake, compiled):
    assert drake.cause == compiled.cause
    assert drake.columns.keys() == compiled.columns.keys()
    for column, values in drake.columns.items():
        # Speeds are differences of places over a tick.
        atol = 1e-6 if "speed" in column else 1e-9
        np.testing.assert_allclose(
            compiled.columns[column], values, rtol=0.0, atol=atol, err_msg=column
        )


@pytest.mark.parametrize("law", ["dwa", "vfh_plus", "mppi"])
def test_a_map_of_echoes_is_enough_for_two_boxes(law):
    """What rests is not touched, and most runs arrive (docs/results_laws.md)."""
    ended = runs("two_static_obstacles", law)
    assert all(run.collision is None for run in ended)
    assert sum(run.cause == "reached" for run in ended) >= LAYOUTS - 2


def test_who_only_stops_touches_nothing_that_rests_and_rarely_arrives():
    ended = runs("two_static_obstacles", "stop_when_near")
    assert all(run.collision is None for run in ended)
    assert sum(run.cause == "reached" for run in ended) <= 3


def test_perfect_knowledge_is_hit_by_nobody():
    """ORCA's promise, of bodies that keep their course (van den Berg, section 3)."""
    ended = runs("two_moving_obstacles", "orca")
    assert all(run.collision is None for run in ended)
    assert all(run.cause == "completed" for run in ended)
