"""What a push holds and costs, against closed forms and another integration."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.integrate import quad, solve_ivp

from analysis.loops.push_and_pull import (
    DESIGNED_LAWS,
    barrier_from_reach_n_m,
    far_offset,
    injected_share,
    kinetic_energy,
    net_barrier,
    rest_offset,
    spring,
)
from analysis.loops.radial_law import radial_law
from analysis.stability.requirements import with_gains
from diagrams.scenario.scenario import Scenario

SCENARIO = Scenario()
K_R, RHO_0, NEAREST = 2.0, 0.8, 0.03


def with_attraction(**changes) -> Scenario:
    attraction = SCENARIO.follower.attraction.model_copy(update=changes)
    return SCENARIO.with_robot(attraction=attraction)


def test_kinetic_energy_at_top_speed():
    """3.94 kg at 0.72 m/s."""
    assert kinetic_energy(SCENARIO) == pytest.approx(1.0212, abs=1e-4)


@given(K_0=st.floats(8.0, 60.0), to_go=st.floats(0.1, 2.5))
def test_net_barrier_of_the_conventional_law(K_0, to_go):
    """A triangle: (K_0 + K_r) (c* - 3 cm)^2/2, c* where push and pull balance."""
    balance = (K_0 * RHO_0 - K_R * to_go) / (K_0 + K_R)
    expected = (K_0 + K_R) / 2.0 * max(0.0, balance - NEAREST) ** 2
    scenario = with_gains(SCENARIO, "conventional", stiffness_n_m=K_0)
    push = spring("conventional", scenario)
    # Between two samples of 5 mm the largest rise is missed by K dx^2/8 at most.
    assert net_barrier(push, scenario, to_go) == pytest.approx(expected, abs=3e-4)


@pytest.mark.parametrize(("ratio", "factor"), [(4.0, 1.0406), (math.e**2, 0.9236)])
def test_barrier_of_the_active_law_without_a_pull(ratio, factor):
    """K_0 rho_0^2/2 times r/(2 ln^2 r), but for the last 3 cm and beyond 3 m."""
    gains = {"reference_stiffness_n_m": 16.0 * ratio, "matched_stiffness_n_m": 16.0}
    scenario = with_gains(with_attraction(stiffness_n_m=1e-12), "active", **gains)
    alpha, k = scenario.follower.laws.active.alpha_m, 16.0 * ratio
    left_out = (
        k
        * alpha
        * (
            alpha
            - (alpha + NEAREST) * math.exp(-NEAREST / alpha)
            + (alpha + 3.0) * math.exp(-3.0 / alpha)
        )
    )
    expected = factor * 16.0 * RHO_0**2 / 2.0 - left_out
    push = spring("active", scenario)
    assert net_barrier(push, scenario, 1.0) == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("law", DESIGNED_LAWS)
def test_net_barrier_is_the_integral_between_the_balances(law):
    push = spring(law, SCENARIO)
    c = np.linspace(NEAREST, 3.0, 100_000)
    net = np.array([push(x) - K_R * (x + 2.0) for x in c])
    inside = c[net > 0.0]
    points = [SCENARIO.follower.laws.active2017.saturation_distance_m]
    expected, _ = quad(
        lambda x: push(x) - K_R * (x + 2.0), inside[0], inside[-1], points=points
    )
    assert net_barrier(push, SCENARIO, 2.0) == pytest.approx(expected, rel=1e-3)


def test_barrier_without_the_limit_of_speed():
    """20.2 N/m with 3 m still to go."""
    assert barrier_from_reach_n_m(SCENARIO, 3.0) == pytest.approx(20.19, abs=0.01)


@pytest.mark.parametrize("law", DESIGNED_LAWS)
def test_stiffest_slope_is_that_of_the_curve(law):
    push = spring(law, SCENARIO)
    c = np.linspace(0.02, 3.0, 300_000)
    slopes = -np.diff([push(x) for x in c]) / np.diff(c)
    found = radial_law(SCENARIO.with_robot(law=law)).stiffest_n_m
    assert found == pytest.approx(slopes.max(), rel=1e-3)


def test_offset_behind_the_master_robot_of_the_conventional_law():
    """None from rho_0 on; nearer, two springs share the gap."""
    assert rest_offset("conventional", SCENARIO) == 0.0
    gains = SCENARIO.follower.laws.conventional
    gap = 0.7 - 0.163
    expected = gains.stiffness_n_m * (RHO_0 - gap) / (K_R + gains.stiffness_n_m)
    near = with_attraction(follow_distance_m=0.7)
    assert rest_offset("conventional", near) == pytest.approx(expected)


def test_offset_behind_the_master_robot_of_2017():
    """K_r x = K_0/(gap + x)."""
    K_0 = SCENARIO.follower.laws.active2017.distance_gain_j
    gap = 1.2 - 0.163
    expected = -gap / 2.0 + math.sqrt(gap**2 / 4.0 + K_0 / K_R)
    assert rest_offset("active2017", SCENARIO) == pytest.approx(expected)


def test_offset_where_the_master_robot_covers_the_follow_point():
    """Printed: d_f = 0. P rests outside of the body, where push and pull balance."""
    scenario = with_attraction(follow_distance_m=0.0)
    offset = rest_offset("active2017", scenario)
    push = radial_law(scenario.with_robot(law="active2017")).function(
        offset - 0.163, 0.0
    )
    assert offset > 0.163
    assert push == pytest.approx(K_R * offset)


def test_offset_by_a_far_echo():
    """d_ref mu_0/K_r, whatever the distance; K_0/(3 K_r) of 2017."""
    active = SCENARIO.follower.laws.active
    tail = active.reference_stiffness_n_m * 3.0 * math.exp(-3.0 / active.alpha_m)
    at_rest = active.reference_damping_n_s_m * active.speed_limit_m_s
    assert far_offset("active", SCENARIO) == pytest.approx((at_rest + tail) / K_R)
    K_0 = SCENARIO.follower.laws.active2017.distance_gain_j
    assert far_offset("active2017", SCENARIO) == pytest.approx(K_0 / 3.0 / K_R)
    assert far_offset("conventional", SCENARIO) == 0.0


def test_share_put_back_by_a_damper_is_that_of_the_dampings():
    scenario = with_gains(SCENARIO, "conventional", damping_n_s_m=0.6)
    assert injected_share("conventional", scenario) == pytest.approx(0.6)
    scenario = with_gains(SCENARIO, "active2017", damping_n_s_m=0.6)
    assert injected_share("active2017", scenario) == pytest.approx(0.6)


@pytest.mark.parametrize(
    ("limit", "steepest"), [(0.72, (0.0, 0.72)), (1.8, (0.8, 1.4))]
)
def test_share_put_back_by_the_active_law(limit, steepest):
    """The term's steepest secant from rest; at mu_0/2 it is D_0 - 2 d_ref.

    A body that comes at the robot is up to twice as fast as its top of 0.72 m/s.
    """
    scenario = with_gains(SCENARIO, "active", speed_limit_m_s=limit)
    gains = scenario.follower.laws.active
    d, b, m = gains.reference_damping_n_s_m, gains.beta_m_s, gains.speed_limit_m_s
    s = np.linspace(1e-4, m, 20_000)
    secants = (d * np.exp(s / b) * (m - s) - d * m) / s
    assert steepest[0] < s[secants.argmax()] < steepest[1]
    share = injected_share("active", scenario)
    assert share == pytest.approx(secants.max(), rel=1e-4)
    assert share >= gains.matched_damping_n_s_m - 2.0 * d


def largest_gain(law: str, scenario: Scenario, start: list[float]) -> float:
    """Largest rise of P's energy before a resting obstacle at the origin, J.

    In the plane, in continuous time, exact sensing; s = |v| as printed.
    """
    force = radial_law(scenario.with_robot(law=law)).function
    mass = scenario.only.robot.mass_kg
    to_rest, D_r = np.array([-2.0, 0.0]), scenario.follower.attraction.damping_n_s_m

    def motion(_, x):
        c, v = np.linalg.norm(x[:2]), x[2:]
        push = force(c, np.linalg.norm(v)) * x[:2] / c
        return [*v, *((K_R * (to_rest - x[:2]) - D_r * v + push) / mass)]

    def energy(x):
        c = np.linalg.norm(x[:2])
        potential, _ = quad(lambda q: force(q, 0.0), c, 3.0, points=[0.1, 0.8])
        pulled = K_R / 2.0 * np.sum((x[:2] - to_rest) ** 2)
        return mass / 2.0 * np.sum(x[2:] ** 2) + pulled + potential

    run = solve_ivp(
        motion, (0.0, 6.0), start, max_step=0.01, rtol=1e-8, dense_output=True
    )
    energies = [energy(x) for x in run.sol(np.linspace(0.0, 6.0, 120)).T]
    return float(np.max(np.diff(energies)))


@pytest.mark.parametrize("law", DESIGNED_LAWS)
@pytest.mark.parametrize(
    "start", [[1.0, 0.0, -0.72, 0.0], [0.6, 0.4, -0.5, 0.3], [0.3, 0.0, 0.0, 0.0]]
)
def test_energy_never_grows_below_a_share_of_one(law, start):
    assert injected_share(law, SCENARIO) < 1.0
    assert largest_gain(law, SCENARIO, start) <= 1e-6


@pytest.mark.parametrize("law", ["conventional", "active2017"])
def test_energy_grows_above_a_share_of_one(law):
    scenario = with_gains(SCENARIO, law, damping_n_s_m=2.5)
    assert largest_gain(law, scenario, [0.12, 0.0, 0.0, 0.0]) > 1e-3


def test_unknown_law_is_refused():
    with pytest.raises(ValueError, match=r"'none' has no gains .* use conventional"):
        spring("none", SCENARIO)
