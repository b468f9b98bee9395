"""Curves of a replay are the columns, thinned."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from analysis.runs.proximity import Proximity
from analysis.views.curves import MOST_POINTS, page_charts, panels
from diagrams import load_scenario, simulate


@pytest.fixture(scope="module")
def charts(crossing_run):
    clearance = {"robot": Proximity(crossing_run).clearance}
    return {chart["title"]: chart for chart in page_charts(crossing_run, clearance)}


def _series(chart, label):
    return next(each for each in chart["series"] if each["label"] == label)


def test_there_is_a_chart_for_each_panel_with_curves(charts):
    assert list(charts) == [
        "range of source (m)",
        "bearing of source (deg)",
        "force on P (N)",
        "speed (m/s)",
        "turn rate (deg/s)",
        "clearance (m)",
    ]


def test_a_curve_is_its_column(crossing_run, charts):
    true = _series(charts["range of source (m)"], "true")
    assert len(true["t"]) <= MOST_POINTS
    column = np.interp(
        true["t"], crossing_run.time, crossing_run.columns["source_range_true"]
    )
    np.testing.assert_allclose(true["values"], column, atol=1e-3)
    assert true["style"] == "line"


def test_estimates_are_dots_where_something_was_heard(crossing_run, charts):
    heard = _series(charts["range of source (m)"], "estimated")
    assert heard["style"] == "dots"
    count = np.count_nonzero(np.isfinite(crossing_run.columns["source_range"]))
    assert len(heard["t"]) == count


def test_a_threshold_goes_from_side_to_side(crossing_run, charts):
    follow = _series(charts["range of source (m)"], "follow distance")
    assert follow["t"] == pytest.approx([0.0, crossing_run.simulated_s])
    assert follow["values"] == pytest.approx([1.2, 1.2])
    assert follow["style"] == "dashes"


def test_the_charts_are_plain_json(charts):
    text = json.dumps(list(charts.values()), allow_nan=False)
    assert "null" not in json.loads(text)[0]["title"]


def test_phases_of_a_search_keep_their_names():
    result = simulate(
        load_scenario("odor_search", ["duration_s=3", "search.rules=song2011"])
    )
    charts = {chart["title"]: chart for chart in page_charts(result, {})}
    phase = next(chart for chart in charts.values() if chart["ticks"])
    assert [text for _, text in phase["ticks"] or []] == [
        "1 initial",
        "2 upwind",
        "3 gradient",
        "4 local",
    ]


@pytest.fixture(scope="module")
def planned_run():
    """By the guarded law, which the guard slows and turns at times."""
    overrides = ["law=guarded", "hearing=ideal", "duration_s=8"]
    return simulate(load_scenario("u_trap", overrides), engine="compiled")


def test_what_a_guard_did_is_a_curve_of_its_column(planned_run):
    """At every tick, however short: a row of the table tells of the tick from it on."""
    charts = {chart["title"]: chart for chart in page_charts(planned_run, {})}
    chart = charts["command, by the guard"]
    did = _series(chart, "what it did")
    assert did["style"] == "steps"
    actions = planned_run.columns["guard_action"]
    assert len(np.unique(actions)) > 1
    middles = planned_run.time[:-1] + 0.5 * planned_run.scenario.tick_s
    at = np.searchsorted(did["t"], middles) - 1
    np.testing.assert_array_equal(np.array(did["values"])[at], actions[:-1])
    assert chart["ticks"] is not None
    assert dict(chart["ticks"]) == {
        0: "passed", 1: "slowed", 2: "turned", 3: "braked", 4: "halted"
    }  # fmt: skip


def test_what_the_law_wanted_stands_beside_what_the_robot_did(planned_run):
    charts = {chart["title"]: chart for chart in page_charts(planned_run, {})}
    for title, column, unit in (
        ("speed (m/s)", "wanted_speed", 1.0),
        ("turn rate (deg/s)", "wanted_turn", 180.0 / np.pi),
    ):
        wanted = _series(charts[title], "wanted by the law")
        assert wanted["style"] == "dashes"
        expected = unit * planned_run.columns[column]
        found = np.interp(wanted["t"], planned_run.time, expected)
        np.testing.assert_allclose(wanted["values"], found, atol=1e-3)


def test_limits_leave_a_twentieth_around_the_curves(crossing_run):
    """As matplotlib's own: 5 % of the range of the values beyond them."""
    (turning,) = (p for p in panels(crossing_run) if p.name == "turn rate")
    rate = np.degrees(crossing_run.columns["omega_WB"])
    margin = 0.05 * (rate.max() - rate.min())
    low, high = turning.limits
    assert (low, high) == pytest.approx((rate.min() - margin, rate.max() + margin))


def test_a_constant_curve_has_an_axis_of_some_length(shortest_run):
    for panel in panels(shortest_run):
        low, high = panel.limits
        assert low < high


def test_a_bearing_has_a_gap_where_it_wraps(crossing_run):
    wrapped = np.where(crossing_run.time < 5.0, 3.1, -3.1)
    columns = {**crossing_run.columns, "source_bearing_true": wrapped}
    (bearing,) = (
        panel
        for panel in panels(replace(crossing_run, columns=columns))
        if panel.name == "bearing of source"
    )
    gaps = np.flatnonzero(np.isnan(bearing.curves[0].y))
    assert gaps.tolist() == [200]
