"""Curves of the laws: those of the formulas, sampled through the blocks."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.loops.law_curves import AT_DISTANCE_M, law_curves, plot_law_curves
from analysis.report.plain_values import plain
from diagrams.scenario.scenario import Scenario
from systems.framework.input_error import InputError
from systems.laws.catalog import FORCE_LAWS
from systems.ranging.parameters import CollisionVectorParameters
from tests.block_forces import block_force

SCENARIO = Scenario.model_validate(
    {
        "laws": {
            "conventional": {"stiffness_n_m": 10.0, "damping_n_s_m": 2.0},
            "active": {
                "matched_stiffness_n_m": 10.0,
                "reference_stiffness_n_m": 40.0,
                "matched_damping_n_s_m": 2.0,
                "reference_damping_n_s_m": 0.5,
            },
            "active2017": {"distance_gain_j": 1.2, "damping_n_s_m": 2.0},
        }
    }
)


def curves_by_law(velocity_term="printed"):
    echoes = CollisionVectorParameters(velocity_term=velocity_term)
    scenario = SCENARIO.with_robot(collision_vector=echoes)
    return {curve.law: curve for curve in law_curves(scenario, FORCE_LAWS)}


def test_laws_meet_where_the_paper_matches_them():
    """K_0 rho_0/2 = 4 N at 0.4 m and D_0 mu_0/2 = 0.72 N more at mu_0/2."""
    for law in ("conventional", "active"):
        scenario = SCENARIO.with_robot(law=law)
        assert block_force(scenario, 0.4, 0.36) == pytest.approx(4.72)


@pytest.mark.parametrize("velocity_term", ["printed", "closing"])
@pytest.mark.parametrize("law", FORCE_LAWS)
def test_curves_are_those_of_the_block(law, velocity_term):
    echoes = CollisionVectorParameters(velocity_term=velocity_term)
    scenario = SCENARIO.with_robot(law=law, collision_vector=echoes)
    curve = curves_by_law(velocity_term)[law]
    for k in (10, 99, 130, 180):
        expected = block_force(scenario, AT_DISTANCE_M, curve.speed_m_s[k])
        assert curve.force_n[k] == pytest.approx(expected, abs=1e-9)
        expected = block_force(scenario, curve.distance_m[k], 0.0)
        assert curve.push_n[k] == pytest.approx(expected, abs=1e-9)


def test_active_force_reaches_beyond_rho_0_and_the_conventional_does_not():
    """Han 2019, figure 6a in words."""
    curves = curves_by_law()
    beyond = curves["active"].distance_m > 0.8 + 1e-9
    assert np.all(curves["conventional"].push_n[beyond] == 0.0)
    assert np.all(curves["active"].push_n[beyond] > 0.0)
    assert np.all(curves["active2017"].push_n[beyond] > 0.0)


def test_speed_counts_below_mu_0_only():
    """Han 2019, figure 6b in words."""
    curve = curves_by_law()["active"]
    above = curve.speed_m_s > 0.72 + 1e-9
    spring = 40.0 * 0.4 / 4.0
    np.testing.assert_allclose(curve.force_n[above], spring)
    below = (curve.speed_m_s < 0.72) & (curve.speed_m_s >= 0.0)
    assert np.all(curve.force_n[below] > spring)


def test_push_of_2017_saturates_below_rho_1_and_above_mu_1():
    """Kim 2017, figure 6 in words."""
    curve = curves_by_law()["active2017"]
    near, fast = curve.distance_m < 0.1, curve.speed_m_s > 0.72
    np.testing.assert_allclose(curve.push_n[near], 12.0)
    np.testing.assert_allclose(curve.force_n[fast], 3.0 + 2.0 * 0.72)


@pytest.mark.parametrize("law", ["conventional", "active", "active2017"])
def test_printed_term_is_even_in_speed_and_closing_ignores_retreat(law):
    printed, closing = curves_by_law()[law], curves_by_law(velocity_term="closing")[law]
    np.testing.assert_allclose(printed.force_n, printed.force_n[::-1], atol=1e-9)
    approach = printed.speed_m_s >= 0.0
    np.testing.assert_allclose(
        closing.force_n[approach], printed.force_n[approach], atol=1e-9
    )
    receding = closing.force_n[~approach]
    at_rest = closing.force_n[approach][0]
    np.testing.assert_allclose(receding, at_rest, atol=1e-9)


def test_unknown_law_is_refused():
    with pytest.raises(InputError, match="'activ' is not known"):
        law_curves(SCENARIO, ["activ"])


def test_picture_draws_every_curve():
    curves = list(curves_by_law().values())
    curves += list(curves_by_law(velocity_term="closing").values())
    by_distance, by_speed = plot_law_curves(curves).axes
    assert len(by_distance.lines) == len(FORCE_LAWS)
    assert len(by_speed.lines) == 2 * len(FORCE_LAWS)
    drawn = np.asarray(by_speed.lines[2].get_ydata())
    np.testing.assert_array_equal(drawn, curves[2].force_n)


def test_plain_form_holds_lists():
    document = plain(curves_by_law()["active"])
    assert document["push_n"][39] == pytest.approx(4.0 + 0.5 * 0.72)
    assert isinstance(document["speed_m_s"], list)
