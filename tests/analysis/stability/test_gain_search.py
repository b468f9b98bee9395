"""The default gains are what the requirements give, and what the bounds say."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from analysis.loops.push_and_pull import DESIGNED_LAWS
from analysis.stability.gain_search import gain_for_barrier, search_gains
from analysis.stability.requirements import (
    Check,
    LawDesign,
    Requirements,
    allowed_stiffness,
    check_law,
    meters_to_go,
)
from diagrams.scenario.participants import LawGains
from diagrams.scenario.scenario import Scenario
from tests.results import documented, numbers

SCENARIO = Scenario()
REQUIREMENTS = Requirements().within_goal(SCENARIO)


def with_attraction(**changes) -> Scenario:
    attraction = SCENARIO.follower.attraction.model_copy(update=changes)
    return SCENARIO.with_robot(attraction=attraction)


def designed(scenario: Scenario, law: str) -> LawDesign:
    scenario = scenario.with_robot(laws=search_gains(scenario, REQUIREMENTS))
    return check_law(scenario, law, REQUIREMENTS)


def unmet(design: LawDesign) -> set[str]:
    return {check.name for check in design.checks if not check.acceptable}


def test_defaults_are_what_the_requirements_give():
    assert search_gains(SCENARIO, REQUIREMENTS) == LawGains()


def test_result_does_not_depend_on_the_gains_it_starts_from():
    other = LawGains.model_validate(
        {
            "conventional": {"stiffness_n_m": 40.0},
            "active": {
                "reference_stiffness_n_m": 64.0,
                "matched_stiffness_n_m": 16.0,
                "reference_damping_n_s_m": 0.2,
            },
        }
    )
    scenario = SCENARIO.with_robot(laws=other)
    assert search_gains(scenario, REQUIREMENTS) == LawGains()


def test_meters_to_go_are_4_less_the_follow_distance_and_rho_0():
    assert meters_to_go(SCENARIO, REQUIREMENTS) == pytest.approx(2.0)


def test_K_0_holds_the_barrier_in_closed_form():
    """(0.8 K_0 - 4 - 0.03 (K_0 + 2))^2 = 2 (K_0 + 2) 1.0212 J."""

    def missing(K_0):
        rise = 0.8 * K_0 - 4.0 - 0.03 * (K_0 + 2.0)
        return rise**2 - 2.0 * (K_0 + 2.0) * 3.94 * 0.72**2 / 2.0

    expected = brentq(missing, 8.0, 40.0)
    found = gain_for_barrier(SCENARIO, "conventional", "stiffness_n_m", REQUIREMENTS)
    assert expected == pytest.approx(12.29, abs=0.01)
    assert found == pytest.approx(expected, rel=1e-3)


def test_K_0_of_2017_holds_the_barrier_in_closed_form():
    """K_0/c against 2 (c + 2.0), from where they are equal in to 3 cm."""

    def missing(K_0):
        balance = math.sqrt(1.0 + K_0 / 2.0) - 1.0
        pull = balance**2 + 4.0 * balance - 0.03**2 - 4.0 * 0.03
        return K_0 * math.log(balance / 0.03) - pull - 3.94 * 0.72**2 / 2.0

    expected = brentq(missing, 0.2, 9.0)
    assert expected == pytest.approx(0.9170, abs=5e-5)
    law, field = "conventional2017", "distance_gain_j"
    found = gain_for_barrier(SCENARIO, law, field, REQUIREMENTS)
    assert found == pytest.approx(expected, rel=1e-3)


def test_contact_allows_what_independent_code_found():
    """Largest K_0 with 50 ms of motor lag and 0, 1, 2, 4 periods of latency."""
    limits = [
        allowed_stiffness(SCENARIO, Requirements(spare_latency_ticks=ticks))
        for ticks in (0, 1, 2, 4)
    ]
    np.testing.assert_allclose(limits, [18.2, 11.5, 8.1, 4.7], atol=0.06)


def test_laws_have_the_same_barrier():
    barriers = [
        check_law(SCENARIO, law, REQUIREMENTS).check("barrier").ratio
        for law in DESIGNED_LAWS
    ]
    np.testing.assert_allclose(barriers, 1.0, atol=0.015)


def test_active_law_meets_every_requirement():
    assert check_law(SCENARIO, "active", REQUIREMENTS).acceptable


def test_conventional_law_cannot_have_both_barrier_and_contact():
    """12.3 N/m are needed, and 11.5 N/m allowed."""
    design = check_law(SCENARIO, "conventional", REQUIREMENTS)
    assert unmet(design) == {"contact stiffness"}
    contact = design.check("contact stiffness")
    assert contact.value / contact.bound == pytest.approx(1.07, abs=0.01)


def test_a_little_more_damping_resolves_it():
    assert designed(with_attraction(damping_n_s_m=1.1), "conventional").acceptable


@pytest.mark.parametrize("law", ["conventional2017", "active2017"])
def test_laws_of_2017_give_contact_and_offsets_for_the_barrier(law):
    design = check_law(SCENARIO, law, REQUIREMENTS)
    expected = {"contact stiffness", "offset behind the source", "offset by a far echo"}
    assert unmet(design) == expected


def test_contact_comes_before_the_offset():
    """With less damping the active law must be softer, and so reach farther."""
    design = designed(with_attraction(damping_n_s_m=0.8), "active")
    assert unmet(design) == {"offset behind the source"}
    assert design.check("contact stiffness").ratio == pytest.approx(1.0, abs=0.01)


def test_ratio_of_a_check_is_above_one_where_it_is_met():
    assert Check("a", 3.0, 2.0, "m", at_least=True).ratio == pytest.approx(1.5)
    assert Check("a", 3.0, 2.0, "m", at_least=False).ratio == pytest.approx(2.0 / 3.0)
    assert not Check("a", 3.0, 2.0, "m", at_least=False).met
    assert Check("a", 0.0, 2.0, "m", at_least=False).met


def test_a_follow_distance_beyond_the_source_is_refused():
    scenario = with_attraction(follow_distance_m=3.5)
    with pytest.raises(ValueError, match=r"attraction.follow_distance_m: .* lower it"):
        search_gains(scenario, REQUIREMENTS)


def test_an_attraction_that_no_push_can_limit_is_refused():
    scenario = with_attraction(stiffness_n_m=1e5)
    with pytest.raises(ValueError, match=r"laws\.conventional\.stiffness_n_m: "):
        search_gains(scenario, REQUIREMENTS)


def test_the_documented_figures():
    designs = [check_law(SCENARIO, law, REQUIREMENTS) for law in DESIGNED_LAWS]
    quoted = {row[0]: row[1:] for row in documented("design", "gains")}
    for check in designs[0].checks:
        for design, cell in zip(designs, quoted[check.name], strict=True):
            found = design.check(check.name)
            number = numbers(cell)[0]
            assert number == pytest.approx(found.value, rel=1e-3, abs=6e-4)
            assert ("**" in cell) == (not found.acceptable)
