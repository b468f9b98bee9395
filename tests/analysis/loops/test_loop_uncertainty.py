"""Uncertain parameters and the loops that they go into."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from analysis.loops.contact_mode import contact_model
from analysis.loops.equilibria import follow_equilibrium
from analysis.loops.radial_law import radial_law
from analysis.loops.robustness import (
    contact_poles,
    contact_uncertainty,
    following_poles,
    following_uncertainty,
    range_slope,
    with_values,
)
from diagrams import load_scenario
from systems.hearing.near_field import source_from_delays


def scenario(law: str = "conventional", *overrides: str):
    return load_scenario("default", [f"law={law}", *overrides])


@given(
    distance=st.floats(0.3, 4.0),
    true_speed=st.floats(325.0, 355.0),
)
def test_range_slope_is_that_of_the_estimators_closed_form(distance, true_speed):
    at = scenario("active", f"attraction.follow_distance_m={distance}")

    def estimated(true_range: float) -> float:
        delay = (true_range - math.hypot(true_range, 0.4)) / true_speed
        return source_from_delays(delay, 0.0, 0.4, 340.0)[1]

    slope = (estimated(distance + 1e-5) - estimated(distance - 1e-5)) / 2e-5
    assert range_slope(at, true_speed) == pytest.approx(slope, rel=1e-6)


def test_stiffness_of_the_laws_is_their_closed_form():
    # K_0; k_ref / e^2 at c = 2 alpha; K_0 / rho_1^2 where the force stops growing.
    gains = scenario().follower.laws
    K_0 = gains.conventional.stiffness_n_m
    assert radial_law(scenario()).stiffest_n_m == pytest.approx(K_0, rel=1e-6)
    peak = gains.active.reference_stiffness_n_m * math.exp(-2.0)
    assert radial_law(scenario("active")).stiffest_n_m == pytest.approx(peak, rel=1e-7)
    kim = gains.active2017
    steepest = kim.distance_gain_j / kim.saturation_distance_m**2
    found = radial_law(scenario("active2017")).stiffest_n_m
    assert found == pytest.approx(steepest, rel=1e-7)
    kim = gains.conventional2017
    steepest = kim.distance_gain_j / 0.03**2  # the least range of the sensors
    found = radial_law(scenario("conventional2017")).stiffest_n_m
    assert found == pytest.approx(steepest, rel=1e-7)
    assert radial_law(scenario("none")).stiffest_n_m == 0.0


def test_values_reach_their_fields():
    changed = with_values(
        scenario(),
        {
            "robot.mass_kg": 5.0,
            "plant.motor_lag_s": 0.07,
            "wheel_radius_share": 1.02,
            "sound_speed_m_s": 340.0,
            "extra_ticks": 1.0,
        },
    )
    assert changed.only.robot.mass_kg == 5.0
    assert changed.only.plant.motor_lag_s == 0.07
    assert changed.only.plant.slip == pytest.approx((-0.02, -0.02))
    assert changed.follower.attraction.stiffness_n_m == pytest.approx(2.0)
    warm = with_values(scenario(), {"sound_speed_m_s": 352.5})
    assert warm.follower.attraction.stiffness_n_m == pytest.approx(
        2.0 * 352.5 / 340, rel=5e-3
    )


@pytest.mark.parametrize("law", ["conventional", "active"])
def test_nominal_poles_are_the_contact_modes(law):
    box = contact_uncertainty(scenario(law))
    poles = contact_poles(scenario(law))({p.name: p.nominal for p in box})
    total = 2.0 + radial_law(scenario(law)).stiffest_n_m
    radius = contact_model(scenario(law), total).spectral_radius
    assert np.abs(poles).max() == pytest.approx(radius, rel=1e-12)


def test_larger_wheels_act_as_stiffer_springs():
    # Springs and damper are of the believed speed and the true position: P moves by
    # (1 + e) times what is commanded, so the spring acts (1 + e) times as strong.
    box = contact_uncertainty(scenario())
    nominal = {p.name: p.nominal for p in box}
    larger = contact_poles(scenario())({**nominal, "wheel_radius_share": 1.02})
    stiffer = contact_poles(scenario())(
        {
            **nominal,
            "attraction.stiffness_n_m": 2.04,
            "law_stiffness_n_m": 1.02 * nominal["law_stiffness_n_m"],
        }
    )
    np.testing.assert_allclose(np.sort(abs(larger)), np.sort(abs(stiffer)), rtol=1e-9)


def test_box_of_the_following_loop_has_the_speed_of_sound():
    by_name = {p.name: p for p in following_uncertainty(scenario())}
    assert by_name["sound_speed_m_s"].low == pytest.approx(334.5)
    assert by_name["sound_speed_m_s"].high == pytest.approx(352.5)


def test_a_law_without_a_spring_has_no_contact_mode():
    with pytest.raises(ValueError, match=r"law: 'none' .* choose another law"):
        contact_uncertainty(scenario("none"))


def test_following_poles_move_with_their_equilibrium():
    # The master robot's push moves the equilibrium when K_r changes; the poles are
    # those that the whole search finds in the changed scenario.
    base = scenario("active", "obstacles=[]", "source.waypoints_m=[[2, 0]]")
    at = follow_equilibrium(base)
    values = {"attraction.stiffness_n_m": 2.2, "plant.motor_lag_s": 0.07}
    moved = follow_equilibrium(with_values(base, values))
    assert np.linalg.norm(moved.p_WP - at.p_WP) > 1e-3
    expected = np.exp(moved.eigenvalues * 0.025)
    found = following_poles(at)(values)
    np.testing.assert_allclose(np.sort(abs(found)), np.sort(abs(expected)), rtol=1e-6)
