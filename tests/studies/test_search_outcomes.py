"""Outcomes of searches over rows of a sweep, and of runs."""

from __future__ import annotations

import pandas as pd
import pytest
from scipy.stats import binomtest

from analysis.batches.comparison_plans import library_layouts
from studies.support.search_outcomes import search_outcomes, search_runs


def test_only_finds_within_the_steps_count():
    table = pd.DataFrame(
        {
            "cause": ["found", "found", "lost", "false find", "found"],
            "search_steps": [4.0, 12.0, 40.0, 6.0, 10.0],
            "search_time_s": [80.0, 240.0, 800.0, 120.0, 200.0],
            "path_efficiency": [0.9, 0.5, 0.1, 0.4, 0.7],
        }
    )
    found = search_outcomes(table)
    assert (found.found, found.within) == (3, 2)
    assert found.causes == {"lost": 1, "false find": 1}
    assert (found.median_steps, found.median_time_s) == (10.0, 200.0)
    exact = binomtest(2, 5).proportion_ci(method="wilson")
    ends = exact.low, exact.high
    assert (found.share.value, *found.share.ends) == pytest.approx((0.4, *ends))


def test_of_several_robots_all_have_to_find():
    table = pd.DataFrame(
        {
            **{f"{name}.search_steps": [3.0, 5.0] for name in "ab"},
            **{f"{name}.search_time_s": [30.0, 50.0] for name in "ab"},
            **{f"{name}.path_efficiency": [0.9, 0.8] for name in "ab"},
            "a.cause": ["found", "found"],
            "b.cause": ["lost", "found"],
        }
    )
    found = search_outcomes(table, ["a", "b"])
    assert (found.found, found.runs) == (1, 2)
    assert found.causes == {"b.lost": 1}


@pytest.mark.slow
def test_runs_are_the_same_again_and_find():
    layouts = library_layouts()["odor_search"]
    first, again = (search_runs(layouts, n, {"search.wait_s": 2.0}) for n in (4, 1))
    assert first["search_steps"].tolist()[:1] == again["search_steps"].tolist()
    assert first["error"].isna().all()
    assert search_outcomes(first).found >= 3
