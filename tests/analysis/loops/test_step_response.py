"""The linear prediction against runs of the diagram; the gang of four."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from analysis.loops.gang_of_four import gang_of_four
from analysis.loops.loop_margins import loop_margins
from analysis.loops.open_loops import open_loop
from analysis.loops.step_response import check_step, fitted_step
from diagrams.scenario.scenario import Scenario
from tests.operating_points import follow_point


@pytest.mark.parametrize("law", ["none", "conventional", "active"])
def test_prediction_is_within_2_percent_of_the_all_ideal_build(law):
    check = check_step(Scenario(law=law))
    assert abs(check.frequency_error) < 0.02
    assert abs(check.damping_error) < 0.02
    assert check.full is None


@pytest.mark.parametrize("law", ["none", "conventional"])
def test_the_predicted_curve_of_a_small_step_is_that_of_the_run(law):
    """The active law's velocity term gives a run one more push as it begins."""
    check = check_step(Scenario(law=law), step_m=0.002)
    off = np.abs(check.predicted_m - check.ideal_m).max()
    assert off < 0.02 * check.step_m


def test_the_corner_of_a_strong_velocity_term_costs_damping():
    """|dC/dt| has no slope at rest: with D_0 as large as D_r, 3 % of damping.

    Without the term the law is smooth, and the prediction exact.
    """
    printed = check_step(Scenario(law="active2017"))
    assert abs(printed.frequency_error) < 0.02
    assert 0.02 < abs(printed.damping_error) < 0.05
    smooth = {"law": "active2017", "laws": {"active2017": {"damping_n_s_m": 1e-9}}}
    check = check_step(Scenario.model_validate(smooth), step_m=0.002)
    assert abs(check.frequency_error) < 1e-3
    assert abs(check.damping_error) < 1e-2


@pytest.mark.slow
def test_full_build_with_audio_and_cones_is_near():
    """Noise, rounding, half a frame more of latency, and the tracker's filter."""
    check = check_step(Scenario(law="conventional"), full=True)
    assert check.full is not None
    assert check.full.frequency_rad_s == pytest.approx(
        check.ideal.frequency_rad_s, rel=0.03
    )
    assert check.full.damping_ratio == pytest.approx(
        check.ideal.damping_ratio, rel=0.15
    )


@settings(max_examples=30)
@given(st.floats(0.3, 2.0), st.floats(0.02, 0.4), st.floats(-0.3, 0.3))
def test_fit_finds_what_was_put_in(omega, zeta, bias):
    t = np.arange(0.0, 25.0, 0.025)
    rate, damped = zeta * omega, omega * np.sqrt(1 - zeta**2)
    x = 1.3 + np.exp(-rate * t) * (0.1 * np.cos(damped * t + 0.3) + 0.1 * bias)
    found = fitted_step(t, x, 1.1 * omega)
    assert found.frequency_rad_s == pytest.approx(omega, rel=1e-4)
    assert found.damping_ratio == pytest.approx(zeta, rel=1e-3)


def test_overdamped_attraction_has_no_oscillation_to_compare():
    heavy = {"law": "none", "attraction": {"damping_n_s_m": 20.0}}
    with pytest.raises(ValueError, match="nothing oscillates"):
        check_step(Scenario.model_validate(heavy))


@pytest.mark.parametrize("law", ["none", "active"])
def test_gang_of_four_is_consistent_with_the_loop(law):
    point = follow_point(Scenario(law=law))
    gang = gang_of_four(point)
    model = open_loop(point, "sensor")
    L = model.response(gang.omega)[0, 0]
    np.testing.assert_allclose(gang.S, 1.0 / (1.0 + L), rtol=1e-6)
    np.testing.assert_allclose(gang.S + gang.T, 1.0)
    margins = loop_margins(model)
    assert gang.peaks["S"] == pytest.approx(margins.sensitivity_peak, rel=1e-2)


def test_a_steady_push_moves_p_by_its_force_over_the_stiffness():
    """At low frequency PS is M / K_r in the other direction: hearing sees it."""
    gang = gang_of_four(follow_point(Scenario(law="none")))
    assert abs(gang.PS[0]) == pytest.approx(3.94 / 2.0, rel=1e-3)
