"""The active law: where it meets the conventional one, its peak and barrier."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.integrate import quad
from scipy.optimize import minimize_scalar

from phonotaxis.testing import assert_linearization, evaluate
from systems.base.robot import RobotParameters
from systems.laws.active import ActiveParameters, active_force
from systems.laws.conventional import ConventionalParameters, conventional_force
from systems.laws.impedance_controller import ActiveImpedanceController
from systems.laws.parameters import AttractionParameters
from tests.systems.laws.one_obstacle import ONE_OBSTACLE


def law(K_0=10.0, ratio=4.0, D_0=3.0, damping_ratio=3.0, **settings):
    """A set of gains with k_ref / K_0 and D_0 / d_ref given."""
    return ActiveParameters(
        matched_stiffness_n_m=K_0,
        reference_stiffness_n_m=K_0 * ratio,
        matched_damping_n_s_m=D_0,
        reference_damping_n_s_m=D_0 / damping_ratio,
        **settings,
    )


def matched(gains):
    """The conventional law that an active one is matched to."""
    return ConventionalParameters(
        stiffness_n_m=gains.matched_stiffness_n_m,
        damping_n_s_m=gains.matched_damping_n_s_m,
        reach_m=gains.reach_m,
    )


any_gains = st.builds(
    law, st.floats(1.0, 50.0), st.floats(1.5, 20.0), st.floats(0.2, 5.0),
    st.floats(1.5, 20.0), reach_m=st.floats(0.3, 2.0),
    speed_limit_m_s=st.floats(0.3, 1.0),
)  # fmt: skip


def spring(c, gains):
    """The law from mu_0 on, where its velocity term is switched off."""
    return active_force(c, 1e3, gains)


def damper(s, gains):
    """At contact the spring is zero."""
    return active_force(0.0, s, gains)


@given(any_gains)
def test_alpha_matches_both_springs_at_half_reach(gains):
    half = gains.reach_m / 2
    conventional = conventional_force(half, 0.0, matched(gains))
    assert spring(half, gains) == pytest.approx(conventional)
    assert conventional == pytest.approx(gains.matched_stiffness_n_m * half)


@given(any_gains)
def test_beta_matches_both_dampers_at_half_the_speed_limit(gains):
    half = gains.speed_limit_m_s / 2
    near = [conventional_force(0.0, s, matched(gains)) for s in (0.0, half)]
    expected = gains.matched_damping_n_s_m * half
    assert near[1] - near[0] == pytest.approx(expected)
    assert damper(half, gains) == pytest.approx(expected)


@given(any_gains)
def test_spring_is_bounded_with_its_peak_at_alpha(gains):
    """k_ref alpha / e; the paper calls the force unbounded."""
    found = minimize_scalar(lambda c: -spring(c, gains), (0.0, gains.alpha_m), tol=1e-9)
    peak = gains.reference_stiffness_n_m * gains.alpha_m / math.e
    assert found.x == pytest.approx(gains.alpha_m, rel=1e-4)
    assert -found.fun == pytest.approx(peak)


def test_peak_in_terms_of_the_ratio():
    """K_0 rho_0 r / (2 e ln r) with r = k_ref / K_0."""
    gains = law(K_0=10.0, ratio=4.0)
    expected = 10.0 * 0.8 * 4.0 / (2 * math.e * math.log(4.0))
    assert spring(gains.alpha_m, gains) == pytest.approx(expected)


def test_spring_vanishes_at_contact_and_far_away():
    assert spring(0.0, law()) == 0.0
    assert spring(30.0, law()) < 1e-30


@pytest.mark.parametrize(("ratio", "factor"), [(4.0, 1.0406), (math.e**2, 0.9236)])
def test_barrier(ratio, factor):
    """K_0 rho_0^2 / 2 times r / (2 ln^2 r), least at r = e^2."""
    gains = law(K_0=10.0, ratio=ratio)
    energy, _ = quad(lambda c: spring(c, gains), 0.0, 40.0, limit=200)
    assert energy == pytest.approx(factor * 10.0 * 0.8**2 / 2, rel=1e-4)


@pytest.mark.parametrize(
    ("s", "force"),
    [(0.0, 1.0 * 0.6), (0.3, 3.0 * 0.3), (0.6, 0.0), (0.7, 0.0), (50.0, 0.0)],
)
def test_velocity_term(s, force):
    """d_ref mu_0 at rest, D_0 mu_0 / 2 at mu_0 / 2, nothing from mu_0 on."""
    gains = law(D_0=3.0, damping_ratio=3.0, speed_limit_m_s=0.6)
    assert damper(s, gains) == pytest.approx(force)


def test_velocity_term_peaks_one_beta_below_its_limit():
    gains = law(damping_ratio=8.0, speed_limit_m_s=0.6)
    found = minimize_scalar(
        lambda s: -damper(s, gains), bounds=(0, 0.6), method="bounded"
    )
    assert found.x == pytest.approx(0.6 - gains.beta_m_s, abs=1e-4)


def test_at_rest_a_far_obstacle_still_pushes():
    """d_ref mu_0 at 2.9 m: the law's own, not ours."""
    gains = law(D_0=3.0, damping_ratio=3.0)
    assert active_force(2.9, 0.0, gains) == pytest.approx(0.72, rel=0.01)


def test_block_adds_attraction_and_repulsion():
    outputs = evaluate(
        ActiveImpedanceController(gains=law()),
        p_WS_estimated=[3.175, 0.0],
        target_valid=[1.0],
        collision_vectors_B=[0.0, 0.4, 0, 0, 0, 0],
        features=[2, 0, 0],
        pose_WB_estimated=[0, 0, 0],
        v_WP=[0.0, 0.0],
    )
    push = 4.0 + 1.0 * 0.72  # half reach, and d_ref mu_0 at rest
    np.testing.assert_allclose(
        outputs["forces_W"], [2.0 * 1.8, 0.0, 0.0, -push], atol=1e-9
    )


@pytest.mark.parametrize("velocity_term", ["printed", "closing"])
@pytest.mark.parametrize("limit", [0.72, 20.0])
def test_gradient(velocity_term, limit):
    """The obstacle moved at about 9 m/s: beyond the limit, and within."""
    block = ActiveImpedanceController(
        robot=RobotParameters(control_point_m=0.2, mass_kg=5.0),
        attraction=AttractionParameters(follow_distance_m=0.6, damping_n_s_m=4.0),
        gains=law(speed_limit_m_s=limit),
        velocity_term=velocity_term,
    )
    assert_linearization(block, **ONE_OBSTACLE)
