"""What velocity terms inject, against closed forms and along runs."""

from __future__ import annotations

import numpy as np
import pytest
from pydrake.symbolic import Expression, Variable, exp
from scipy.optimize import minimize_scalar

from analysis.energy.velocity_passivity import (
    energy_balance,
    velocity_term_passivity,
)


def test_conventional_term_injects_d0_when_printed(two_boxes):
    printed = velocity_term_passivity(two_boxes("conventional"))
    closing = velocity_term_passivity(two_boxes("conventional"), "closing")
    assert printed.largest_injection_n_s_m == pytest.approx(0.8)
    assert not printed.passive_alone
    assert printed.covered
    assert closing.passive_alone


def test_active_term_has_the_steepest_chord_of_the_formula(two_boxes):
    """d_ref (exp(s/beta)(mu_0 - s) - mu_0)/s: greatest inside, least at mu_0."""
    found = velocity_term_passivity(two_boxes("active"))
    beta, mu = 0.6 / (2.0 * np.log(4.0)), 0.6

    def chord(s):
        return 0.2 * (np.exp(s / beta) * (mu - s) - mu) / s

    best = minimize_scalar(lambda s: -chord(s), bounds=(0.01, 0.6), method="bounded")
    assert found.rise_n_s_m == pytest.approx(-best.fun, abs=1e-3)
    assert found.fall_n_s_m == pytest.approx(0.2, abs=1e-3)


def test_saturating_term_of_2017_injects_d0(two_boxes):
    found = velocity_term_passivity(two_boxes("active2017"))
    assert found.largest_injection_n_s_m == pytest.approx(0.8, abs=1e-9)


def test_more_damping_than_d_r_is_not_covered(two_boxes):
    stronger = "laws.conventional.damping_n_s_m=1.2"
    assert not velocity_term_passivity(two_boxes("conventional", stronger)).covered


@pytest.mark.parametrize("law", ["conventional", "active", "active2017"])
@pytest.mark.parametrize("term", ["printed", "closing"])
def test_energy_is_balanced_along_a_run(two_boxes, law, term):
    """V = V(0) + injected - dissipated while the clamp rests, of 10 J."""
    fast = "robot.top_speed_m_s=5.0"
    balance = energy_balance(two_boxes(law, fast), velocity_term=term)
    rest = balance.energies_j - balance.energies_j[0]
    np.testing.assert_allclose(
        rest, balance.injected_j - balance.dissipated_j, atol=0.03
    )


@pytest.mark.parametrize("law", ["conventional", "active", "active2017"])
def test_covered_energy_never_grows(two_boxes, law):
    balance = energy_balance(two_boxes(law))
    assert balance.passivity.covered
    assert np.diff(balance.energies_j).max() < 1e-6
    bound = balance.passivity.largest_injection_n_s_m
    ratio = bound / balance.passivity.attraction_damping_n_s_m
    assert np.all(balance.injected_j <= ratio * balance.dissipated_j + 1e-4)


def test_energy_falls_by_symbols():
    """V' = -D_r |v|^2 + (f(c, s) - f(c, 0)) u.v, term by term.

    r is the distance from the source and q = 1/r, with r' = q e.v, e = p - p_S;
    c' = u.v.
    """
    names = ("ex", "ey", "r", "q", "vx", "vy", "ux", "uy", "f0", "f", "K", "D", "d")
    ex, ey, r, q, vx, vy, ux, uy, f0, f, K, D, d = map(Variable, names)
    ax = -K * (r - d) * q * ex - D * vx + f * ux  # M times the acceleration
    ay = -K * (r - d) * q * ey - D * vy + f * uy
    u_v = ux * vx + uy * vy
    dot = vx * ax + vy * ay + K * (r - d) * q * (ex * vx + ey * vy) - f0 * u_v
    claim = -D * (vx * vx + vy * vy) + (f - f0) * u_v
    assert (dot - claim).Expand().EqualTo(Expression(0.0))


def test_potentials_differentiate_to_the_laws():
    """dU/dc = -f(c, 0), in symbols: linear, exponential, and the constant push."""
    c, K, rho, k, a, push, R = map(Variable, ("c", "K", "rho", "k", "a", "push", "R"))
    linear = K * (rho - c) * (rho - c) / 2
    gap = linear.Differentiate(c) + K * (rho - c)
    assert gap.Expand().EqualTo(Expression(0.0))
    active = k * a * (c + a) * exp(-c / a) + push * (R - c)
    gap = (active.Differentiate(c) + k * c * exp(-c / a) + push) * a
    rng = np.random.default_rng(5)
    for _ in range(100):
        values = dict(zip((c, k, a, push, R), rng.uniform(0.1, 3.0, 5), strict=True))
        assert abs(gap.Evaluate(values)) < 1e-9
