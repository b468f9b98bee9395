"""The avoidance formulas of both papers as printed, against geometry and our code.

Every test stands behind a row of docs/errata.md. What the paper prints is
transcribed here and nowhere else.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from systems.base.robot import RobotParameters
from systems.laws.active import ActiveParameters, active_force
from systems.laws.active_2017 import Active2017Parameters, active_2017_force
from systems.laws.conventional import ConventionalParameters, conventional_force
from systems.laws.conventional_2017 import (
    Conventional2017Parameters,
    conventional_2017_force,
)
from systems.laws.impedance_controller import repulsion_force
from systems.ranging.collision_vector import echo_point, foot_on_segment
from systems.world.geometry import rotate

#: K_0 = 16 N/m, k_ref = 64 N/m, rho_0 = 0.8 m: alpha = 0.4 / ln 4 m.
LAW = ActiveParameters(
    matched_stiffness_n_m=16.0,
    matched_damping_n_s_m=0.8,
    reach_m=0.8,
    reference_stiffness_n_m=64.0,
    reference_damping_n_s_m=0.2,
    speed_limit_m_s=0.6,
)
CONVENTIONAL = ConventionalParameters(
    stiffness_n_m=16.0, damping_n_s_m=0.8, reach_m=0.8
)

laws = st.builds(
    lambda K_0, r, rho_0, D_0, q, mu_0: ActiveParameters(
        matched_stiffness_n_m=K_0,
        reference_stiffness_n_m=r * K_0,
        reach_m=rho_0,
        matched_damping_n_s_m=D_0,
        reference_damping_n_s_m=D_0 / q,
        speed_limit_m_s=mu_0,
    ),
    *(
        st.floats(low, high)
        for low, high in ((1, 99), (1.1, 9), (0.2, 3), (0.1, 9), (1.1, 9), (0.1, 3))
    ),
)
angles = st.floats(-math.pi, math.pi)
ranges = st.floats(0.03, 3.0)
small = st.floats(-0.3, 0.3)


def matched(law: ActiveParameters) -> ConventionalParameters:
    """The conventional law that an active one is matched to."""
    return ConventionalParameters(
        stiffness_n_m=law.matched_stiffness_n_m,
        damping_n_s_m=law.matched_damping_n_s_m,
        reach_m=law.reach_m,
    )


@given(range_=ranges, axis=angles, x=small, y=small)
def test_han_eq_11_points_away_from_the_echo(range_, axis, x, y) -> None:
    along = np.array([math.cos(axis), math.sin(axis)])
    echo = np.array([x, y]) + range_ * along
    printed = np.array([x, y]) - range_ * along
    assert np.linalg.norm(printed - echo) == pytest.approx(2.0 * range_)
    assert echo_point(range_, axis, (x, y)) == pytest.approx(echo)


@given(range_=ranges, angle=st.floats(-math.pi / 6, math.pi / 6))
def test_han_eq_13_swaps_the_axes(range_, angle) -> None:
    """theta is counted from Y_R, the direction of travel."""
    printed = np.array([range_ * math.cos(angle), range_ * math.sin(angle)])
    from_Y_R = math.acos(printed[1] / range_)
    assert from_Y_R == pytest.approx(math.pi / 2 - angle)
    forward, left = echo_point(range_, angle, (0.0, 0.0))
    assert math.atan2(left, forward) == pytest.approx(angle)


def printed_eq_14(a, b):
    V = (a[1] - b[1]) / (a[0] - b[0])
    x = (V * a[0] - a[1]) / (V + 1 / V)
    y = (a[0] + 1 / V * a[1]) / (V + 1 / V)
    return x, y


@given(
    distance=ranges,
    turn=st.floats(0.1, math.pi / 2 - 0.1) | st.floats(-math.pi / 2 + 0.1, -0.1),
    left=st.floats(0.01, 0.5),
    right=st.floats(0.01, 0.5),
)
def test_han_eq_14_has_a_wrong_sign(distance, turn, left, right) -> None:
    """A face at a known distance, whose normal from P is turned by a known angle."""
    foot = distance * np.array([math.cos(turn), math.sin(turn)])
    along = np.array([-math.sin(turn), math.cos(turn)])
    a, b = foot + left * along, foot - right * along
    x, y = printed_eq_14(a, b)
    slope = along[1] / along[0]
    assert x == pytest.approx(foot[0])
    assert y - foot[1] == pytest.approx(2.0 * a[0] / (slope + 1.0 / slope))
    assert foot_on_segment(a, b) == pytest.approx(foot)


def test_han_eq_14_in_numbers() -> None:
    """A face that runs from 0.8 m ahead to 0.8 m on the left."""
    a, b = (0.8, 0.0), (0.0, 0.8)
    assert printed_eq_14(a, b) == pytest.approx((0.4, -0.4))
    assert foot_on_segment(a, b) == pytest.approx((0.4, 0.4))


@pytest.mark.parametrize(
    ("a", "b", "foot"),
    [((0.8, 0.2), (0.8, -0.1), (0.8, 0.0)), ((0.3, 0.4), (-0.2, 0.4), (0.0, 0.4))],
)
def test_han_eq_14_is_singular_along_either_axis(a, b, foot) -> None:
    with pytest.raises(ZeroDivisionError):
        printed_eq_14(a, b)
    assert foot_on_segment(a, b) == pytest.approx(foot)


def test_han_eq_14_leaves_the_segment() -> None:
    """Both echoes on the left, and a foot on the right of P."""
    a, b = (1.0, 0.6), (0.8, 0.3)
    normal = np.array([0.3, -0.2]) / math.hypot(0.3, 0.2)
    foot = np.dot(a, normal) * normal
    assert foot == pytest.approx([0.4154, -0.2769], abs=1e-4)
    assert foot_on_segment(a, b) == b


@given(theta=angles, x=small, y=small)
def test_han_eq_15_turns_from_world_to_robot(theta, x, y) -> None:
    c, s = math.cos(theta), math.sin(theta)
    printed = np.array([[c, s], [-s, c]])
    assert rotate(theta, *(printed @ (x, y))) == pytest.approx((x, y))
    assert printed.T @ (x, y) == pytest.approx(rotate(theta, x, y))


def test_han_eq_15_in_numbers() -> None:
    """The robot faces +y of W; an echo 1 m ahead lies 1 m along +y."""
    printed = np.array([[0.0, 1.0], [-1.0, 0.0]])
    assert printed @ (1.0, 0.0) == pytest.approx([0.0, -1.0])
    assert rotate(math.pi / 2, 1.0, 0.0) == pytest.approx((0.0, 1.0))


def test_han_eq_16_measures_from_the_origin_of_the_world() -> None:
    """An obstacle 0.5 m ahead of a robot at (3, 4) m pushes with 4.8 N."""
    x_0, y_0, x_w, y_w = 3.0, 4.0, 0.5, 0.0
    printed = math.hypot(x_0 + x_w, y_0 + x_w)
    corrected = math.hypot(x_0 + x_w, y_0 + y_w)
    assert printed == pytest.approx(5.701, abs=1e-3)
    assert corrected == pytest.approx(5.315, abs=1e-3)
    assert conventional_force(printed, 0.0, CONVENTIONAL) == 0.0
    assert conventional_force(corrected, 0.0, CONVENTIONAL) == 0.0
    force = repulsion_force((x_w, y_w), 0.0, conventional_force, (CONVENTIONAL,))
    assert force == pytest.approx((-4.8, 0.0))


def printed_F_os(p, p_o, v, v_o, K=16.0, D=0.8):
    return K * (p - p_o) + D * (v - v_o)


def test_han_eq_18_grows_with_distance() -> None:
    """Doubling the distance doubles the force; eq. 19-a lowers it."""
    near, far = printed_F_os(-0.3, 0.0, 0.0, 0.0), printed_F_os(-0.6, 0.0, 0.0, 0.0)
    assert (near, far) == pytest.approx((-4.8, -9.6))
    assert conventional_force(0.3, 0.0, CONVENTIONAL) == pytest.approx(8.0)
    assert conventional_force(0.6, 0.0, CONVENTIONAL) == pytest.approx(3.2)


def test_han_eq_18_drives_the_velocity() -> None:
    """x'' = (K x + D x') / M: the damper's power is D v^2 > 0."""
    M, K, D = RobotParameters().mass_kg, 16.0, 0.8
    assert printed_F_os(0.0, 0.0, 0.5, 0.0) * 0.5 == pytest.approx(D * 0.25)
    fastest = max(np.roots([M, -D, -K]).real)
    assert fastest == pytest.approx(2.119, abs=1e-3)


def test_han_eq_17_pulls_into_the_obstacle() -> None:
    """M x'' = -F_os: the obstacle is a stable rest of the robot."""
    M, K, D = RobotParameters().mass_kg, 16.0, 0.8
    assert -printed_F_os(-0.3, 0.0, 0.0, 0.0) == pytest.approx(4.8)
    assert max(np.roots([M, D, K]).real) == pytest.approx(-0.1015, abs=1e-4)
    rest, approach = (conventional_force(0.3, s, CONVENTIONAL) for s in (0.0, 0.4))
    assert approach - rest == pytest.approx(D * 0.4)


def printed_eq_19b(c, s, law):
    K_0 = law.reference_stiffness_n_m * math.exp(-c / law.alpha_m) * c
    growth = math.exp(s / law.beta_m_s)
    D_0 = law.reference_damping_n_s_m * growth * (law.speed_limit_m_s - s)
    return K_0 * (law.reach_m - c), D_0 * s


def printed_eq_20(c, s, law):
    spring = law.reference_stiffness_n_m * math.exp(-c / law.alpha_m) * c
    growth = math.exp(s / law.beta_m_s)
    damper = law.reference_damping_n_s_m * growth * (law.speed_limit_m_s - s)
    return spring, damper


def test_han_eq_19b_attracts_beyond_rho_0() -> None:
    spring, _ = printed_eq_19b(1.2, 0.0, LAW)
    assert spring == pytest.approx(-0.48)
    assert printed_eq_20(1.2, 0.0, LAW)[0] == pytest.approx(1.2)
    assert active_force(1.2, LAW.speed_limit_m_s, LAW) == pytest.approx(1.2)


def test_han_eq_19b_and_20_differ_at_rest() -> None:
    """K_0 rho_0 / 2 = 6.4 N is what eq. 21 wants; d_ref mu_0 = 0.12 N at rest."""
    assert printed_eq_19b(0.4, 0.0, LAW) == pytest.approx((2.56, 0.0))
    assert printed_eq_20(0.4, 0.0, LAW) == pytest.approx((6.4, 0.12))
    assert active_force(0.4, 0.0, LAW) == pytest.approx(6.52)


@given(law=laws, c=ranges, part=st.floats(0.0, 0.999))
def test_active_force_is_han_eq_20(law, c, part) -> None:
    s = part * law.speed_limit_m_s
    assert active_force(c, s, law) == pytest.approx(sum(printed_eq_20(c, s, law)))


@given(law=laws)
def test_han_eq_21_makes_the_springs_equal_at_half_rho_0(law) -> None:
    c = law.reach_m / 2.0
    wanted = law.matched_stiffness_n_m * law.reach_m / 2.0
    assert conventional_force(c, 0.0, matched(law)) == pytest.approx(wanted)
    assert active_force(c, law.speed_limit_m_s, law) == pytest.approx(wanted)


@given(law=laws)
def test_han_eq_22_for_beta_makes_the_dampers_equal_at_half_mu_0(law) -> None:
    s, far = law.speed_limit_m_s / 2.0, 1e3
    wanted = law.matched_damping_n_s_m * s
    assert active_force(far, s, law) == pytest.approx(wanted, rel=1e-6)
    c = law.reach_m / 2.0
    conventional = conventional_force(c, s, matched(law))
    assert active_force(c, s, law) == pytest.approx(conventional)


def test_han_eq_22_as_printed_misses_the_matching_point() -> None:
    """The repeated alpha = 0.2885 m in the place of beta = 0.2164 m/s."""
    alpha = 0.8 / (2.0 * math.log(64.0 / 16.0))
    assert alpha == pytest.approx(0.2885, abs=1e-4)
    assert pytest.approx(0.2164, abs=1e-4) == LAW.beta_m_s
    printed = 0.2 * math.exp(0.3 / alpha) * (0.6 - 0.3)
    assert printed == pytest.approx(0.1697, abs=1e-4)
    assert active_force(1e3, 0.3, LAW) == pytest.approx(0.24)


@given(law=laws, c=ranges)
def test_han_3_3_force_is_bounded(law, c) -> None:
    at_mu_0 = law.speed_limit_m_s
    peak = law.reference_stiffness_n_m * law.alpha_m / math.e
    K_0 = law.matched_stiffness_n_m
    ratio = law.reference_stiffness_n_m / K_0
    by_ratio = K_0 * law.reach_m * ratio / (2 * math.e * math.log(ratio))
    assert by_ratio == pytest.approx(peak)
    assert active_force(law.alpha_m, at_mu_0, law) == pytest.approx(peak)
    assert active_force(c, at_mu_0, law) <= peak * (1.0 + 1e-12)


def test_han_3_3_force_vanishes_at_contact() -> None:
    """Conventional 12.8 N there, active at most 6.79 N, at c = 0.289 m."""
    assert conventional_force(0.0, 0.0, CONVENTIONAL) == pytest.approx(12.8)
    assert active_force(0.0, LAW.speed_limit_m_s, LAW) == 0.0
    peak = active_force(LAW.alpha_m, LAW.speed_limit_m_s, LAW)
    assert peak == pytest.approx(6.794, abs=1e-3)


@given(law=laws, part=st.floats(0.0, 1.0))
def test_han_3_3_speed_force_falls_to_zero_at_mu_0(law, part) -> None:
    """Largest at mu_0 - beta, or at rest where beta >= mu_0."""
    mu_0, beta, d_ref = law.speed_limit_m_s, law.beta_m_s, law.reference_damping_n_s_m
    peak = d_ref * mu_0
    if beta < mu_0:
        peak = d_ref * beta * math.exp(mu_0 / beta - 1.0)
        assert active_force(0.0, mu_0 - beta, law) == pytest.approx(peak)
    assert active_force(0.0, part * mu_0, law) <= peak * (1.0 + 1e-12)
    assert active_force(0.0, mu_0, law) == 0.0


def test_han_mu_0_is_below_the_closing_speed() -> None:
    """0.72 m/s toward an obstacle that comes at 0.3 m/s."""
    law = LAW.model_copy(update={"speed_limit_m_s": 0.72})
    top_speed = RobotParameters().top_speed_m_s
    assert top_speed + 0.3 == pytest.approx(1.02)
    assert active_force(0.4, top_speed + 0.3, law) == active_force(0.4, 0.72, law)
    assert active_force(0.4, 0.46, law) - active_force(0.4, 0.72, law) > 0.3


def test_kim_eq_20_is_bounded_by_the_sensors_alone() -> None:
    """K_0/c doubles as c halves; ours stops at the sensors' least range, 3 cm."""
    gains = Conventional2017Parameters(distance_gain_j=1.2, damping_n_s_m=0.8)
    printed = [1.2 / c for c in (0.12, 0.06, 0.03, 0.015)]
    assert printed == pytest.approx([10.0, 20.0, 40.0, 80.0])
    found = [
        conventional_2017_force(c, 0.0, gains, least_range_m=0.03)
        for c in (0.12, 0.06, 0.03, 0.015)
    ]
    assert found == pytest.approx([10.0, 20.0, 40.0, 40.0])


@given(c=st.floats(0.0, 3.0), s=st.floats(0.0, 2.0))
def test_kim_eq_20_and_21_differ_where_eq_21_saturates(c, s) -> None:
    """Nearer than 100 mm, and faster than mu_1, here 0.72 m/s: nowhere else."""
    gains = {"distance_gain_j": 1.2, "damping_n_s_m": 0.8}
    conventional = conventional_2017_force(
        c, s, Conventional2017Parameters(**gains), least_range_m=0.03
    )
    active = active_2017_force(c, s, Active2017Parameters(**gains))
    if c >= 0.1 and s <= 0.72:
        assert active == conventional
    elif c < 0.0999 or s > 0.7201:
        assert active < conventional


def test_han_table_6_swaps_width_and_length() -> None:
    """820 mm can only be across: wheels 410 mm and microphones 800 mm apart."""
    robot = RobotParameters()
    assert robot.length_m < robot.wheel_separation_m < robot.width_m
    left, _, right = (y for _, y in robot.microphones_m)
    assert robot.width_m - (left - right) == pytest.approx(0.02)
