"""Contact mode: the chain of blocks against closed forms and another method."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.integrate import solve_ivp

from analysis.loops.contact_mode import (
    contact_limits,
    contact_model,
    largest_contact_stiffness,
    motion_chain,
)
from analysis.loops.equilibria import find_equilibria
from diagrams.scenario.scenario import Scenario

T, MASS, LAG = 0.025, 3.94, 0.05
SCENARIO = Scenario()
#: Largest K_0 by independent code (design notes): 0, 1, 2 and 4 ticks.
NOTED = {0.05: (18, 11.5, 8.1, 4.7), 0.02: (48, 20, 12, 6.4), 0.1: (8.3, 6.2, 4.8, 3.1)}


def test_chain_is_the_lagged_double_integrator():
    """A unit acceleration for one tick, then none: scipy integrates the motor."""
    chain = motion_chain(SCENARIO)
    state = chain.B[:, 0]
    found = []
    for _ in range(40):
        found.append(chain.C @ state)
        state = chain.A @ state

    def motor(_, x):
        return [x[1], (T - x[1]) / LAG]

    exact = solve_ivp(
        motor, (0, 1), [0, 0], t_eval=T * np.arange(1, 41), rtol=1e-10, atol=1e-12
    )
    np.testing.assert_allclose(np.array(found)[:, 0], exact.y[0], atol=1e-9)
    np.testing.assert_allclose(np.array(found)[:, 1], T, atol=1e-14)


def test_chain_has_no_more_states_than_the_motion():
    assert motion_chain(SCENARIO).A.shape == (3, 3)


@given(st.floats(0.1, 60.0), st.floats(0.05, 20.0), st.integers(0, 4))
def test_matrix_has_the_poles_of_the_difference_equation(stiffness, damping, ticks):
    """(z - 1) v = T a, the lag's recursion, p of some ticks ago: a polynomial."""
    model = contact_model(
        SCENARIO, stiffness, damping_n_s_m=damping, latency_ticks=ticks
    )
    decay = math.exp(-T / LAG)
    # p (z - 1) = b w + c v+, w (z - decay) = (1 - decay) v+, with v+ = z v.
    b, c = LAG * (1 - decay), T - LAG * (1 - decay)
    z = np.poly1d([1.0, 0.0])
    moved = c * (z - decay) + b * (1 - decay)
    late = np.poly1d([1.0] + [0.0] * ticks)
    k, d = stiffness * T / MASS, damping * T / MASS
    polynomial = (z - 1 + d) * (z - 1) * (z - decay) * late + k * moved * z
    found = np.poly(model.A)
    np.testing.assert_allclose(found, polynomial.coeffs, atol=1e-9)


@pytest.mark.parametrize("lag", list(NOTED))
def test_largest_stiffness_is_that_of_the_design_notes(lag):
    for ticks, noted in zip((0, 1, 2, 4), NOTED[lag], strict=True):
        total = largest_contact_stiffness(
            SCENARIO, motor_lag_s=lag, latency_ticks=ticks
        )
        assert total - 2.0 == pytest.approx(noted, abs=0.6 if noted > 10 else 0.06)


def test_limit_separates_decay_from_growth():
    limit = largest_contact_stiffness(SCENARIO)
    assert contact_model(SCENARIO, 0.99 * limit).spectral_radius < 1.0
    assert contact_model(SCENARIO, 1.01 * limit).spectral_radius > 1.0


@settings(max_examples=20)
@given(st.floats(0.001, 0.05), st.floats(0.05, 5.0))
def test_without_lag_the_held_velocity_condition_decides(period, damping):
    """D > 0 and 2 D T + K T^2 < 4 for a unit mass, as the lag goes to zero."""
    limit = largest_contact_stiffness(
        SCENARIO, damping_n_s_m=damping, motor_lag_s=1e-9, period_s=period
    )
    exact = (4.0 - 2.0 * damping / MASS * period) / period**2 * MASS
    if exact < 1e5:
        assert limit == pytest.approx(exact, rel=1e-3)


@pytest.mark.parametrize("stiffness", [10.0, 17.8, 18.7])
def test_radial_modes_of_the_whole_diagram_are_those_of_the_chain(stiffness):
    """At the saddle before a corner that points at P: AutoDiff of one period."""
    scenario = Scenario.model_validate(
        {
            "law": "conventional",
            "source": {"waypoints_m": [[3.0, 0.0]], "length_m": 1e-3, "width_m": 1e-3},
            "attraction": {"follow_distance_m": 0.0},
            "laws": {"conventional": {"stiffness_n_m": stiffness}},
            "obstacles": [
                {
                    "waypoints_m": [[1.0, 0.0]],
                    "size_m": [1e-6, 1e-6],
                    "heading_deg": 45.0,
                }
            ],
        }
    )
    points = find_equilibria(scenario, area_m=(-1.0, 0.99, -1.0, 1.0)).points
    (point,) = [p for p in points if p.p_WP[1] == pytest.approx(0.0, abs=1e-6)]
    radial = np.log(contact_model(SCENARIO, stiffness + 2.0).poles) / T
    # The lag's own pole is off by the third-order step: exp(-0.5) as 0.6042.
    for pole in radial[np.abs(radial) < 5.0]:
        assert np.abs(point.eigenvalues - pole).min() < 5e-3
    radius = contact_model(SCENARIO, stiffness + 2.0).spectral_radius
    assert (radius < 1.0) == (stiffness < 18.25)


def test_no_damping_no_spring():
    assert largest_contact_stiffness(SCENARIO, damping_n_s_m=0.0) == 0.0


def test_table_marks_today_and_falls_with_lag_and_latency():
    limits = contact_limits(SCENARIO)
    assert limits.today == (0.05, 0)
    # The table of docs/results_stability.md.
    assert limits.motor_lags_s == (0.01, 0.02, 0.05, 0.1, 0.2)
    assert limits.latency_ticks == (0, 1, 2, 3, 4)
    for lag, noted in NOTED.items():
        row = limits.stiffness_n_m[limits.motor_lags_s.index(lag)]
        for found, own in zip(row[[0, 1, 2, 4]], noted, strict=True):
            assert found == pytest.approx(own, abs=0.6 if own > 10 else 0.06)
    # Gains of docs/avoidance.md.
    assert limits.stiffness_today_n_m == 12.3
    assert limits.reference_stiffness_today_n_m == 84.5
    assert (np.diff(limits.stiffness_n_m, axis=0) < 0).all()
    assert (np.diff(limits.stiffness_n_m, axis=1) < 0).all()
    np.testing.assert_allclose(
        limits.reference_stiffness_n_m, limits.stiffness_n_m * math.e**2
    )


def test_approaching_obstacles_damp():
    """D_0 on the change over a tick acts as on a velocity half a tick ago."""
    damped = contact_model(Scenario(), 12.0, approach_damping_n_s_m=0.8).growth_per_s
    as_velocity = contact_model(Scenario(), 12.0, damping_n_s_m=1.8).growth_per_s
    plain = contact_model(Scenario(), 12.0).growth_per_s
    # The damper acts on the true motion, behind the motors' lag.
    assert plain - damped == pytest.approx(plain - as_velocity, rel=0.2)
