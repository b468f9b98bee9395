"""The law of 2017: inverse distance, saturation, and its block."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from systems.active_impedance_2017_controller import (
    ActiveImpedance2017Controller,
    active_2017_force,
)
from systems.impedance import AttractionParameters
from systems.repulsion import Active2017Parameters, RepulsionParameters
from systems.robot import RobotParameters

GAINS = Active2017Parameters(
    distance_gain_j=1.2,
    saturation_distance_m=0.1,
    damping_n_s_m=3.0,
    saturation_speed_m_s=0.72,
)
POINT = [2.0, 0.4, 0.6, 0.1, 0.2, 0.3, -0.1, -0.1]

any_gains = st.builds(
    Active2017Parameters,
    distance_gain_j=st.floats(0.1, 9.0),
    saturation_distance_m=st.floats(0.02, 0.5),
    damping_n_s_m=st.floats(0.1, 9.0),
    saturation_speed_m_s=st.floats(0.1, 2.0),
)
distance = st.floats(0.0, 3.0)
speed = st.floats(0.0, 5.0)


@pytest.mark.parametrize(
    ("c", "s", "force"),
    [
        (1.2, 0.0, 1.0),
        (0.6, 0.0, 2.0),
        (0.1, 0.0, 12.0),
        (0.05, 0.0, 12.0),
        (0.0, 0.0, 12.0),
        (1.2, 0.5, 2.5),
        (1.2, 0.72, 3.16),
        (1.2, 60.0, 3.16),
    ],
)
def test_force(c, s, force):
    assert active_2017_force(c, s, GAINS) == pytest.approx(force)


@given(any_gains, distance, speed)
def test_force_is_kim_eq_21_with_the_gains_of_figure_6(gains, c, s):
    """K_a(c)/c + D_a(s) s as the text draws K_a and D_a, away from 0/0."""
    c, s = max(c, 1e-3), max(s, 1e-3)
    K_a = gains.distance_gain_j * min(1.0, c / gains.saturation_distance_m)
    D_a = gains.damping_n_s_m * min(1.0, gains.saturation_speed_m_s / s)
    expected = K_a / c + D_a * s
    assert active_2017_force(c, s, gains) == pytest.approx(expected, rel=1e-12)


@given(any_gains, distance, speed)
def test_push_saturates_in_distance_and_in_speed(gains, c, s):
    """K_0/rho_1 and D_0 mu_1: the reasons that the paper gives for K_a and D_a."""
    top = gains.distance_gain_j / gains.saturation_distance_m
    fastest = gains.damping_n_s_m * gains.saturation_speed_m_s
    assert 0.0 < active_2017_force(c, 0.0, gains) <= top
    assert active_2017_force(0.0, 0.0, gains) == pytest.approx(top)
    assert active_2017_force(c, s, gains) <= (top + fastest) * (1 + 1e-12)


@given(any_gains, distance, distance, speed, speed)
def test_force_never_falls_as_an_obstacle_nears_or_hurries(gains, c, q, s, w):
    near, far, slow, fast = min(c, q), max(c, q), min(s, w), max(s, w)
    weakest = active_2017_force(far, slow, gains)
    assert active_2017_force(near, fast, gains) >= weakest * (1 - 1e-12)


@given(any_gains)
def test_barrier_grows_with_the_logarithm_of_the_reach(gains):
    """K_0 (1 + ln(c/rho_1)) from contact to c: without bound, unlike 2019's."""
    near = gains.saturation_distance_m
    for reach in (1.0, 3.0, 30.0):
        energy, _ = quad(
            lambda c: active_2017_force(c, 0.0, gains), 0.0, reach, points=[near]
        )
        expected = gains.distance_gain_j * (1.0 + math.log(reach / near))
        assert energy == pytest.approx(expected, rel=1e-6)


def test_block_adds_attraction_and_repulsion(bench):
    block = ActiveImpedance2017Controller(
        repulsion=RepulsionParameters(active2017=GAINS)
    )
    at = bench(
        block,
        p_WS_estimated=[3.175, 0.0],
        target_valid=[1.0],
        collision_vectors_B=[0.0, 0.4, 0, 0, 0, 0],
        features=[2, 0, 0],
        pose_WB_estimated=[0, 0, 0],
        v_WP=[0.0, 0.0],
    )
    np.testing.assert_allclose(
        at.output("forces_W"), [2.0 * 1.8, 0.0, 0.0, -3.0], atol=1e-9
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
def test_gradient(controller_bench, check_gradient, velocity_term, saturation):
    """The obstacle, at 0.61 m, moved at about 9 m/s."""

    def respond(block, x):
        at = controller_bench(block, x)
        outputs = [*at.output("acceleration_W"), *at.output("forces_W")]
        return [*outputs, *at.output("obstacle_speeds"), *at.updated()]

    block = ActiveImpedance2017Controller(
        robot=RobotParameters(control_point_m=0.2, mass_kg=5.0),
        attraction=AttractionParameters(follow_distance_m=0.6, damping_n_s_m=4.0),
        repulsion=RepulsionParameters(
            velocity_term=velocity_term, active2017=GAINS.model_copy(update=saturation)
        ),
    )
    check_gradient(block, respond, POINT)
