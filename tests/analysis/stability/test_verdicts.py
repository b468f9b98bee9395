"""Numbers against thresholds."""

from __future__ import annotations

import math
from types import SimpleNamespace

import pytest

from analysis.certificates.energy_certificate import certify_energy
from analysis.stability.law_analysis import Study
from analysis.stability.verdict_readings import read_start
from analysis.stability.verdicts import Criterion, compare_verdicts, judge

MARGIN = Criterion(
    "phase margin", "deg", "at least", 45.0, "robust", "fragile", "textbook"
)


@pytest.mark.parametrize(
    ("sense", "below", "at", "above"),
    [
        ("at least", False, True, True),
        ("above", False, False, True),
        ("at most", True, True, False),
        ("below", True, False, False),
    ],
)
def test_limits_are_met_from_the_right_side(sense, below, at, above):
    criterion = Criterion("x", "", sense, 1.0, "good", "bad", "test")
    met = [criterion.met_by(value) for value in (0.9, 1.0, 1.1)]
    assert met == [below, at, above]


def test_verdicts_say_what_follows():
    assert judge(MARGIN, 60.0).text == "robust"
    assert judge(MARGIN, 20.2).verdict == "fail"
    assert judge(MARGIN, math.inf).verdict == "pass"
    missing = judge(MARGIN, None, "there is no loop")
    assert (missing.verdict, missing.text) == ("not applicable", "there is no loop")
    assert judge(MARGIN, None).text == "this law has no such number"
    assert MARGIN.threshold == "\u2265 45 deg"


def test_laws_of_one_verdict_stand_together():
    rows = compare_verdicts(
        {
            "a": [judge(MARGIN, 20.0)],
            "b": [judge(MARGIN, 50.0)],
            "c": [judge(MARGIN, 30.0)],
        }
    )
    assert len(rows) == 1
    assert rows[0].text == "a and c: fragile. b: robust."
    assert rows[0].verdicts == {"a": "fail", "b": "pass", "c": "fail"}
    same = compare_verdicts({law: [judge(MARGIN, 20.0)] for law in "abc"})
    assert same[0].text == "All: fragile."
    two = compare_verdicts({law: [judge(MARGIN, 50.0)] for law in "ab"})
    assert two[0].text == "a and b: robust."
    (one,) = compare_verdicts({"a": [judge(MARGIN, 50.0)]})
    assert (one.text, one.values) == ("robust.", {"a": 50.0})


def test_laws_are_compared_by_name_in_the_first_ones_order():
    gain = Criterion("gain margin", "dB", "above", 6.0, "ample", "scant", "textbook")
    rows = compare_verdicts(
        {
            "a": [judge(MARGIN, 50.0), judge(gain, 6.0)],
            "b": [judge(gain, 7.0), judge(MARGIN, 20.0)],
        }
    )
    assert [row.name for row in rows] == ["phase margin", "gain margin"]
    assert [row.values for row in rows] == [
        {"a": 50.0, "b": 20.0},
        {"a": 6.0, "b": 7.0},
    ]
    assert rows[1].text == "a: scant. b: ample."


@pytest.mark.parametrize(("spring_n_m", "certified"), [(0.01, 0.0), (1000.0, 1.0)])
def test_a_start_is_certified_by_the_spring_before_it(two_boxes, spring_n_m, certified):
    """A box stands on the way down to the source; 1000 N/m hold 320 J, 0.01 nothing."""
    stiffness = f"laws.conventional.stiffness_n_m={spring_n_m}"
    damping = "laws.conventional.damping_n_s_m=0.001"
    scenario = two_boxes("conventional", stiffness, damping)
    certificate = certify_energy(scenario, cell_m=0.02)
    found = {"certificates": [SimpleNamespace(certificate=certificate)]}
    assert read_start(Study(scenario, found)) == certified
