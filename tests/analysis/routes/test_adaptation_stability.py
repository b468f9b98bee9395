"""Adaptation of a scenario: closed forms, and the figures of the design."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.routes.adaptation_stability import (
    adaptation_stability,
    critical_rate,
    drift_stiffness,
)
from analysis.routes.point_run import PointLoop, run_point
from diagrams import load_scenario
from systems.framework.input_error import InputError
from systems.laws.trajectory.sampled_bounds import (
    SampledMass,
    rate_bound,
    sampled_matrix,
)
from systems.laws.trajectory.trajectory_adaptive import AdaptiveTrajectoryParameters

LAW = AdaptiveTrajectoryParameters()
PREFIX = "laws.trajectory_adaptive"


def found(*fields):
    scenario = load_scenario("unknown_block", ["law=trajectory_adaptive", *fields])
    return adaptation_stability(scenario)


@pytest.fixture(scope="module")
def literal():
    return found()


@pytest.fixture(scope="module")
def gradient():
    return found(f"{PREFIX}.rule=sensitivity")


def test_a_point_is_the_closed_form_of_its_matrix():
    """40 ticks to rest from where it is off, by powers of the one-period matrix."""
    loop = PointLoop(LAW.model_copy(update={"rate": 0.0}), motor_lag_s=0.05)
    of = SampledMass(loop.robot.mass_kg, 0.05, 0.025)
    run = run_point(loop, np.zeros((41, 4)), start=(0.3, -0.2, 0.1, 0.05))
    for axis, start in enumerate(([0.3, 0.1, 0.1], [-0.2, 0.05, 0.05])):
        state = np.linalg.matrix_power(sampled_matrix(3.0, 4.0, of), 40) @ start
        assert run.motion[40, axis] == pytest.approx(state[0], rel=1e-9)
        assert run.motion[40, 2 + axis] == pytest.approx(state[2], rel=1e-9)


def test_v_of_the_literal_rule_falls(literal):
    run = literal.lyapunov
    assert run.falls
    assert run.largest_rise <= 1e-9
    assert run.continuous[0] == 1.0
    assert run.continuous[-1] < 1e-3
    np.testing.assert_allclose(run.gains[-1], run.wanted, rtol=0.01)
    # Sampled, with the motors' lag, it is no Lyapunov function.
    assert 1e-9 < run.sampled_rise < 0.1


def test_a_gradient_has_no_such_function(gradient):
    assert gradient.lyapunov is None


def test_the_gradient_drifts_and_the_literal_rule_does_not(literal, gradient):
    """8.60, 15.25 and 27.11 N/m after 60, 600 and 6000 s of 1.5 N."""
    assert gradient.drift.push_n == 1.5
    expected = [8.60, 15.25, 27.11]
    closed = [drift_stiffness(3.0, 10.0, 1.5, t) for t in (60.0, 600.0, 6000.0)]
    np.testing.assert_allclose(closed, expected, atol=0.005)
    np.testing.assert_allclose(gradient.drift.simulated_n_m, expected, rtol=0.03)
    assert max(literal.drift.simulated_n_m) < 4.5


def test_limits_bound_what_drifts_and_what_jams(gradient):
    limited = found(f"{PREFIX}.rule=sensitivity", f"{PREFIX}.projected=true")
    assert limited.bounded
    assert max(limited.drift.limited_n_m) <= 6.0
    np.testing.assert_allclose(
        limited.drift.simulated_n_m, [8.60, 15.25, 27.11], rtol=0.03
    )
    assert limited.jam.end_n_m[1] <= 6.0
    assert limited.jam.left_n_m[1] <= 6.0
    assert limited.jam.end_n_m[0] > 20.0
    assert not gradient.bounded
    assert gradient.drift.limited_n_m == gradient.drift.simulated_n_m


@pytest.mark.parametrize("rule", ["lyapunov", "sensitivity"])
def test_the_critical_rate_is_that_of_the_design(rule, literal, gradient):
    """gamma_crit a^2 constant: some 2.1e3 literal, 1.1e3 to 1.8e3 by the gradient."""
    data = {"lyapunov": literal, "sensitivity": gradient}[rule]
    products = [each.product for each in data.products]
    assert max(products) / min(products) < 1.05
    low, high = {"lyapunov": (1.6e3, 4.2e3), "sensitivity": (0.55e3, 3.6e3)}[rule]
    assert low < products[0] < high
    assert data.critical.amplitude_m == 1.0
    assert data.margin == data.critical.rate / 10.0
    # The bound that warns is below what runs away, and no more than a tenth of it.
    warned = rate_bound(rule, 1.0, SampledMass(1.0, 0.05, 0.025))
    assert 0.1 * data.critical.rate < warned < data.critical.rate


def test_below_the_critical_rate_nothing_runs_away():
    loop = PointLoop(LAW, motor_lag_s=0.05)
    assert critical_rate(loop, 0.01).rate == np.inf


def test_the_reference_has_the_nominal_poles(literal):
    """s^2 + 4 s + 3 for K = 3, D = 4, M = 1; over a tick their exponentials."""
    poles = np.sort(literal.reference_poles.real)
    np.testing.assert_allclose(poles, [-3.0, -1.0])
    held = np.sort(literal.held_poles.real)
    np.testing.assert_allclose(held, np.exp(0.025 * poles), rtol=1e-12)


def test_what_does_not_adapt_is_refused():
    with pytest.raises(InputError, match=r"law: .* has no adaptation"):
        found("law=trajectory_filtered")
