"""One record per metric: what readers are told is what runs have."""

from __future__ import annotations

import re

import pytest

from analysis.runs.metric_table import GROUPS, METRICS, metric_label, run_metrics
from diagrams import load_scenario, simulate
from docs.building.result_blocks import ROOT


def test_every_metric_has_one_record():
    names = [metric.name for group in GROUPS for metric in group.metrics]
    assert len(names) == len(set(names)) == len(METRICS)


def test_every_group_has_a_table_in_the_documents():
    text = (ROOT / "docs" / "metrics.md").read_text("utf-8")
    found = re.findall(r"<!-- generated: metrics_(\w+) -->", text)
    assert sorted(found) == sorted(group.name for group in GROUPS)


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("jerk_rms_m_s3", "m/s³"),
        ("last_damping_n_s_m", "N s/m"),
        ("turn_reversals_per_s", "1/s"),
        ("following_bearing_rms_deg", "deg"),
        ("contact_push_n", "N"),
        ("search_steps", ""),
        ("replans", ""),
    ],
)
def test_names_end_in_their_units(name, unit):
    """As everywhere in this project: SI units by name endings."""
    assert METRICS[name].unit == unit


@pytest.mark.parametrize(
    ("name", "label"),
    [
        ("jerk_rms_m_s3", "rms jerk (m/s³)"),
        ("sparc", "SPARC"),
        ("near.minimum_clearance_m", "near: least clearance (m)"),
        ("a_users_own", "a users own"),
    ],
)
def test_labels(name, label):
    assert metric_label(name) == label


def test_texts_have_the_unit_and_a_dash_for_nothing():
    assert METRICS["minimum_clearance_m"].text(0.37256) == "0.373 m"
    assert METRICS["search_steps"].text(5.0) == "5"
    assert METRICS["spl"].text(None) == "-"


def test_a_run_has_the_metrics_of_its_kind():
    """A search has no jerk; a follower has no steps, and without cones no echoes."""
    search = run_metrics(simulate(load_scenario("odor_search", ["duration_s=2"])))
    alike, own = (
        {metric.name for metric in group.metrics}
        for group in GROUPS
        if group.name in ("all", "search")
    )
    assert set(search) == alike | own
    route = ["law=trajectory_conventional", "duration_s=2"]
    driven = run_metrics(simulate(load_scenario("unknown_block", route)))
    assert alike < set(driven)
    assert not own & set(driven)
    assert {"replans", "jerk_rms_m_s3", "slip_way_m"} < set(driven)
    assert not {"contact_push_n", "detections", "last_damping_n_s_m"} & set(driven)
