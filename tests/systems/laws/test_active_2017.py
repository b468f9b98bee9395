"""The active law of 2017, by hand from the words and numbers of Kim 2017.

Section 3.3 and 5: the push K_0/c grows as an obstacle nears, until rho_1 = 100 mm,
and is then saturated; the velocity term D_0 s is effective below mu_1, and does not
ask for more than the top speed of 720 mm/s above it. K_0 and D_0 are not printed;
1.2 N m and 3 N s/m make figures that can be worked out on paper.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from phonotaxis.testing import assert_linearization, evaluate
from systems.base.robot import RobotParameters
from systems.laws.active_2017 import Active2017Parameters, active_2017_force
from systems.laws.impedance_controller import ActiveImpedance2017Controller
from systems.laws.parameters import AttractionParameters
from tests.systems.laws.one_obstacle import ONE_OBSTACLE

GAINS = Active2017Parameters(
    distance_gain_j=1.2,
    saturation_distance_m=0.1,
    damping_n_s_m=3.0,
    saturation_speed_m_s=0.72,
)


def slope(function, x, h=1e-6):
    return (function(x + h) - function(x - h)) / (2.0 * h)


def test_numbers_that_the_paper_prints():
    """100 mm and 720 mm/s (Kim 2017, experiment 2)."""
    gains = Active2017Parameters()
    assert gains.saturation_distance_m == 0.1
    assert gains.saturation_speed_m_s == RobotParameters().top_speed_m_s == 0.72


@pytest.mark.parametrize(
    ("c", "push"),
    [(3.0, 0.4), (1.0, 1.2), (0.4, 3.0), (0.2, 6.0), (0.1, 12.0)],
)
def test_push_at_rest_from_rho_1_on(c, push):
    assert active_2017_force(c, 0.0, GAINS) == pytest.approx(push, rel=1e-12)


@pytest.mark.parametrize("c", [0.0999, 0.05, 0.03, 0.0])
def test_push_nearer_than_rho_1_is_that_at_rho_1(c):
    assert active_2017_force(c, 0.0, GAINS) == pytest.approx(12.0, rel=1e-12)


@pytest.mark.parametrize(
    ("s", "more"), [(0.0, 0.0), (0.1, 0.3), (0.5, 1.5), (0.72, 2.16)]
)
@pytest.mark.parametrize("c", [0.05, 1.0])
def test_velocity_term_up_to_mu_1_is_three_times_the_speed(c, s, more):
    """At any distance: it comes on top."""
    at_rest = active_2017_force(c, 0.0, GAINS)
    assert active_2017_force(c, s, GAINS) == pytest.approx(at_rest + more, rel=1e-12)


@pytest.mark.parametrize("s", [0.7201, 1.44, 60.0])
def test_velocity_term_above_mu_1_is_that_at_mu_1(s):
    assert active_2017_force(1.0, s, GAINS) == pytest.approx(1.2 + 2.16, rel=1e-12)


@pytest.mark.parametrize(
    ("c", "by_c"), [(1.0, -1.2), (0.2, -30.0), (0.11, -99.1735537), (0.09, 0.0)]
)
def test_slope_in_distance(c, by_c):
    """-1.2/c^2, and none where the push is saturated."""
    found = slope(lambda x: active_2017_force(x, 0.3, GAINS), c)
    assert found == pytest.approx(by_c, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize(("s", "by_s"), [(0.1, 3.0), (0.71, 3.0), (0.73, 0.0)])
def test_slope_in_speed(s, by_s):
    found = slope(lambda x: active_2017_force(0.5, x, GAINS), s)
    assert found == pytest.approx(by_s, abs=1e-6)


@pytest.mark.parametrize(
    ("reach", "energy"),
    [(0.1, 1.2), (1.0, 3.9631021), (3.0, 5.2814369), (30.0, 8.0445390)],
)
def test_energy_from_contact_out(reach, energy):
    """1.2 J (1 + ln(reach/0.1 m)): it grows without bound, unlike 2019's."""
    found, _ = quad(
        lambda c: active_2017_force(c, 0.0, GAINS), 0.0, reach, points=[0.1]
    )
    assert found == pytest.approx(energy, rel=1e-6)


def test_each_gain_is_read_from_its_own_field():
    gains = Active2017Parameters(
        distance_gain_j=0.7,
        saturation_distance_m=0.35,
        damping_n_s_m=0.2,
        saturation_speed_m_s=0.5,
    )
    assert active_2017_force(0.3, 0.4, gains) == pytest.approx(2.08, rel=1e-12)
    assert active_2017_force(0.7, 0.6, gains) == pytest.approx(1.10, rel=1e-12)


def test_block_adds_attraction_and_repulsion():
    block = ActiveImpedance2017Controller(gains=GAINS)
    outputs = evaluate(
        block,
        p_WS_estimated=[3.175, 0.0],
        target_valid=[1.0],
        collision_vectors_B=[0.0, 0.4, 0, 0, 0, 0],
        features=[2, 0, 0],
        pose_WB_estimated=[0, 0, 0],
        v_WP=[0.0, 0.0],
    )
    np.testing.assert_allclose(
        outputs["forces_W"], [2.0 * 1.8, 0.0, 0.0, -3.0], atol=1e-9
    )


@pytest.mark.parametrize("velocity_term", ["printed", "closing"])
@pytest.mark.parametrize(
    "saturation",
    [
        {},
        {"saturation_speed_m_s": 20.0},
        {"saturation_distance_m": 1.0, "saturation_speed_m_s": 20.0},
    ],
)
def test_gradient(velocity_term, saturation):
    """The obstacle, at 0.61 m, moved at about 9 m/s."""
    block = ActiveImpedance2017Controller(
        robot=RobotParameters(control_point_m=0.2, mass_kg=5.0),
        attraction=AttractionParameters(follow_distance_m=0.6, damping_n_s_m=4.0),
        gains=GAINS.model_copy(update=saturation),
        velocity_term=velocity_term,
    )
    assert_linearization(block, **ONE_OBSTACLE)
