"""Velocity terms about contact: closed forms of poles, biases and dampings."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import iv, modstruve

from studies.nonlinear.head_on import head_on
from studies.nonlinear.velocity_terms import velocity_term_analysis

TO_GO = 1.7


@pytest.fixture(scope="module")
def conventional(two_boxes):
    return velocity_term_analysis(two_boxes("conventional"), to_go_m=TO_GO)


@pytest.fixture(scope="module")
def active(two_boxes):
    return velocity_term_analysis(two_boxes("active"), to_go_m=TO_GO)


def test_contact_equilibrium_of_the_conventional_law(conventional):
    """K_0 (rho_0 - c) = K_r (L + c)."""
    expected = (16.0 * 0.8 - 2.0 * TO_GO) / 18.0
    assert conventional.contact.equilibrium_m == pytest.approx(expected)
    assert conventional.contact.stiffness_n_m == pytest.approx(18.0)


def test_to_go_is_that_of_the_obstacle_nearest_to_the_way(two_boxes):
    assert head_on(two_boxes("conventional")).to_go_m == pytest.approx(4.5 - 1.6 - 1.2)


@pytest.mark.parametrize("term", ["printed", "closing"])
def test_one_sided_dampings(conventional, term):
    variant = conventional.variants[term]
    assert variant.approaching.damping_n_s_m == pytest.approx(1.8)
    expected = 0.2 if term == "printed" else 1.0
    assert variant.receding.damping_n_s_m == pytest.approx(expected)
    for side in (variant.approaching, variant.receding):
        real = -side.damping_n_s_m / (2.0 * 3.94)
        assert side.poles.real == pytest.approx([real, real])
        assert abs(side.poles[0]) == pytest.approx(math.sqrt(18.0 / 3.94))


@pytest.mark.parametrize("term", ["printed", "closing"])
def test_amplitude_ratio_of_a_cycle_is_that_of_the_motion(conventional, term):
    """Integrated: from rest outside of the equilibrium to the next rest there."""
    variant = conventional.variants[term]

    def slope(_, y):
        s = abs(y[1]) if term == "printed" else max(0.0, -y[1])
        return [y[1], (-18.0 * y[0] - y[1] + 0.8 * s) / 3.94]

    def rest(_, y):
        return y[1]

    rest.direction = -1  # type: ignore[attr-defined]
    motion = solve_ivp(
        slope,
        (0.0, 4.0),
        [0.1, 0.0],
        events=rest,
        rtol=1e-10,
        atol=1e-13,
        max_step=0.01,
    )
    pairs = zip(motion.t_events[0], motion.y_events[0], strict=True)
    later = [y[0] for t, y in pairs if t > 0.1]
    assert later[0] / 0.1 == pytest.approx(variant.amplitude_ratio, rel=1e-6)


def test_describing_function_of_the_conventional_term(conventional):
    """|c'|: bias 2 D_0 A/pi, no damping. Closing: half of the bias, D_0/2."""
    printed = conventional.variants["printed"].describing
    closing = conventional.variants["closing"].describing
    amplitude = printed.amplitudes_m_s
    bias = 2.0 * 0.8 * amplitude / math.pi
    np.testing.assert_allclose(printed.bias_n, bias, rtol=1e-4)
    np.testing.assert_allclose(printed.damping_n_s_m, 0.0, atol=1e-12)
    np.testing.assert_allclose(closing.bias_n, bias / 2.0, rtol=1e-4)
    np.testing.assert_allclose(closing.damping_n_s_m, 0.4, rtol=1e-4)


def test_describing_function_of_the_exponential_term(active):
    """Mean of exp(z |cos|) is I_0(z) + L_0(z), with the modified Struve function.

    That of |cos| exp(z |cos|) is its derivative, I_1(z) + L_1(z) + 2/pi.
    """
    found = active.variants["printed"].describing
    beta, mu = 0.6 / (2.0 * math.log(4.0)), 0.6
    below = found.amplitudes_m_s < mu
    amplitude = found.amplitudes_m_s[below]
    z = amplitude / beta
    mean = iv(0, z) + modstruve(0, z)
    weighted = iv(1, z) + modstruve(1, z) + 2.0 / math.pi
    expected = 0.2 * (mu * mean - amplitude * weighted) - 0.2 * mu
    np.testing.assert_allclose(found.bias_n[below], expected, atol=2e-5)
    np.testing.assert_allclose(found.damping_n_s_m, 0.0, atol=1e-12)


@pytest.mark.parametrize("name", ["conventional", "active"])
def test_the_blocks_difference_gives_nearly_the_same(name, request):
    """A tick is a 24th of the cycle: within 2 % of the largest."""
    analysis = request.getfixturevalue(name)
    for variant in analysis.variants.values():
        found = variant.describing
        for exact, sampled in (
            (found.bias_n, found.sampled_bias_n),
            (found.damping_n_s_m, found.sampled_damping_n_s_m),
        ):
            scale = max(np.abs(exact).max(), 0.01)
            np.testing.assert_allclose(sampled, exact, atol=0.02 * scale)


def test_active_law_has_an_inner_equilibrium_that_is_a_source(active):
    outer, inner = active.contact.equilibria_m
    assert active.contact.slope(outer) < 0.0 < active.contact.slope(inner)
    assert active.contact.equilibrium_m == outer


def test_a_law_that_cannot_hold_is_refused(two_boxes):
    with pytest.raises(
        ValueError, match=r"law: 'none' does not hold P .* 1.70 m to go"
    ):
        velocity_term_analysis(two_boxes("none"))
    with pytest.raises(ValueError, match="to_go_m: -1 must not be negative"):
        velocity_term_analysis(two_boxes("active"), to_go_m=-1)
