"""What is asked of gains, and how near they come: bounds that are written down here."""

from __future__ import annotations

import json

import pytest

from analysis.report.plain_values import plain
from analysis.stability.requirements import (
    Check,
    LawDesign,
    Requirements,
    check_law,
    meters_to_go,
    with_gains,
)
from diagrams.scenario.scenario import Scenario

SCENARIO = Scenario()


def test_bounds_are_the_scenarios_and_the_requirements():
    """3.94 kg at 0.72 m/s; 11.5 N/m by independent code; the goal's margin."""
    asked = Requirements(far_offset_m=0.04, injected_share=0.7)
    checks = check_law(SCENARIO, "active", asked).checks
    bounds = {check.name: (check.bound, check.unit) for check in checks}
    assert bounds == {
        "barrier": (pytest.approx(0.5 * 3.94 * 0.72**2), "J"),
        "contact stiffness": (pytest.approx(11.5, abs=0.06), "N/m"),
        "offset behind the source": (0.1, "m"),
        "offset by a far echo": (0.04, "m"),
        "energy put back": (0.7, "1"),
    }
    assert [check.name for check in checks if check.at_least] == ["barrier"]


@pytest.mark.parametrize("at_least", [True, False])
def test_a_bound_is_acceptable_to_one_per_cent_and_met_exactly(at_least):
    for ratio, acceptable in ((0.985, False), (0.995, True), (2.0, True)):
        value = 2.0 * ratio if at_least else 2.0 / ratio
        check = Check("a", value, 2.0, "m", at_least)
        assert check.ratio == pytest.approx(ratio)
        assert check.acceptable == acceptable
        assert check.met == (ratio >= 1.0)


def test_nothing_asked_is_met_by_anything():
    assert Check("a", 3.0, 0.0, "m", at_least=True).met
    assert Check("a", 0.0, 0.0, "m", at_least=False).met


def test_a_design_is_met_if_all_its_checks_are():
    good = Check("a", 3.0, 2.0, "m", at_least=True)
    bad = Check("b", 1.0, 2.0, "m", at_least=True)
    assert LawDesign("active", {}, (good,)).acceptable
    assert not LawDesign("active", {}, (good, bad)).acceptable
    assert LawDesign("active", {}, (good, bad)).check("b") is bad


def test_json_has_no_infinite_ratio():
    free = Check("free", 3.0, 0.0, "m", at_least=True)
    half = Check("half", 4.0, 2.0, "N", at_least=False)
    found = plain(LawDesign("active", {"K_0": 1.5}, (free, half)))
    assert json.loads(json.dumps(found, allow_nan=False)) == {
        "law": "active",
        "gains": {"K_0": 1.5},
        "acceptable": False,
        "checks": [
            {"name": "free", "value": 3.0, "bound": 0.0, "unit": "m",
             "at_least": True, "ratio": None, "met": True, "acceptable": True},
            {"name": "half", "value": 4.0, "bound": 2.0, "unit": "N",
             "at_least": False, "ratio": 0.5, "met": False, "acceptable": False},
        ],
    }  # fmt: skip


def test_meters_to_go_are_what_reach_and_follow_distance_leave():
    asked = Requirements(source_range_m=5.0)
    wide = with_gains(SCENARIO, "conventional", reach_m=1.0)
    assert meters_to_go(wide, asked) == pytest.approx(5.0 - 1.2 - 1.0)
    with pytest.raises(ValueError, match="lower it"):
        meters_to_go(SCENARIO, Requirements(source_range_m=2.0))
