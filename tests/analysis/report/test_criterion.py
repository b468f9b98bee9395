"""Numbers against thresholds."""

from __future__ import annotations

import math

import pytest

from analysis.report.criterion import Bounds, Criterion, Reading, compare_verdicts


def as_it_is(value: Reading) -> Reading:
    return value


MARGIN = Criterion(
    "phase margin", "deg", "at least", 45.0, "robust", "fragile", "textbook", as_it_is
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
    criterion = Criterion("x", "", sense, 1.0, "good", "bad", "test", as_it_is)
    met = [criterion.met_by(value) for value in (0.9, 1.0, 1.1)]
    assert met == [below, at, above]


def test_verdicts_say_what_follows():
    assert MARGIN.judge(60.0).text == "robust"
    assert MARGIN.judge(20.2).verdict == "fail"
    assert MARGIN.judge(math.inf).verdict == "pass"
    for missing in (
        MARGIN.judge("there is no loop"),
        MARGIN.without_number("there is no loop"),
    ):
        assert (missing.verdict, missing.value) == ("not applicable", None)
        assert missing.text == "there is no loop"
    assert MARGIN.judge(math.nan).text == "there is no such number"
    assert MARGIN.threshold == "\u2265 45 deg"


@pytest.mark.parametrize(
    ("found", "proven", "verdict"),
    [
        (60.0, 50.0, "pass"),
        (60.0, 40.0, "undecided"),
        (60.0, -math.inf, "undecided"),
        (40.0, 30.0, "fail"),
    ],
)
def test_a_threshold_between_the_bounds_is_undecided(found, proven, verdict):
    judged = MARGIN.judge(Bounds(found, proven))
    assert (judged.value, judged.proven, judged.verdict) == (found, proven, verdict)
    assert ("not proven" in judged.text) == (verdict == "undecided")
    (row,) = compare_verdicts({"a": [judged]})
    assert row.proven == {"a": proven}


def test_laws_of_one_verdict_stand_together():
    rows = compare_verdicts(
        {
            "a": [MARGIN.judge(20.0)],
            "b": [MARGIN.judge(50.0)],
            "c": [MARGIN.judge(30.0)],
        }
    )
    assert len(rows) == 1
    assert rows[0].text == "a and c: fragile. b: robust."
    assert rows[0].verdicts == {"a": "fail", "b": "pass", "c": "fail"}
    same = compare_verdicts({law: [MARGIN.judge(20.0)] for law in "abc"})
    assert same[0].text == "All: fragile."
    two = compare_verdicts({law: [MARGIN.judge(50.0)] for law in "ab"})
    assert two[0].text == "a and b: robust."
    (one,) = compare_verdicts({"a": [MARGIN.judge(50.0)]})
    assert (one.text, one.values) == ("robust.", {"a": 50.0})


def test_laws_are_compared_by_name_in_the_first_ones_order():
    gain = Criterion(
        "gain margin", "dB", "above", 6.0, "ample", "scant", "textbook", as_it_is
    )
    rows = compare_verdicts(
        {
            "a": [MARGIN.judge(50.0), gain.judge(6.0)],
            "b": [gain.judge(7.0), MARGIN.judge(20.0)],
        }
    )
    assert [row.name for row in rows] == ["phase margin", "gain margin"]
    assert [row.values for row in rows] == [
        {"a": 50.0, "b": 20.0},
        {"a": 6.0, "b": 7.0},
    ]
    assert rows[1].text == "a: scant. b: ample."
