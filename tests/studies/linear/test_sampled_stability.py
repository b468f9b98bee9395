"""Sampling: conditions, periods and charts against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

from analysis.loops.burst_cycle import burst_cycle
from analysis.loops.contact_mode import contact_model, largest_contact_stiffness
from diagrams.scenario.scenario import Scenario
from studies.linear.burst_gaps import gap_chart
from studies.linear.root_locus import root_loci
from studies.linear.sampled_stability import (
    check_conditions,
    gain_chart,
    gain_delay_chart,
    poles_against_period,
)
from tests.operating_points import follow_point

M, K, D, T, LAG = 3.94, 2.0, 1.0, 0.025, 0.05


def test_closed_form_conditions_hold_for_10_000_pairs_each():
    for check in check_conditions(10_000):
        assert check.mismatches == 0, check
        assert 1000 < check.stable < 9000, "both sides of the boundary are tried"


def test_longest_stable_period_is_the_held_velocity_conditions():
    """2 D T + K T^2 < 4 M where the lag has died out within a period."""
    quick = Scenario.model_validate({"plant": {"motor_lag_s": 0.01}})
    periods = np.linspace(0.5, 4.0, 701)
    found = poles_against_period(quick, periods_s=periods)
    exact = (-D + math.sqrt(D**2 + 4 * K * M)) / K
    assert found.longest_stable_s == pytest.approx(exact, abs=0.03)


def test_poles_at_todays_period_are_those_of_the_operating_point():
    point = follow_point(Scenario(law="none"))
    found = poles_against_period(Scenario(), periods_s=[T])
    slow = np.log(found.poles[0][np.abs(found.poles[0]) > 0.7]) / T
    for pole in slow:
        assert np.abs(point.eigenvalues - pole).min() < 1e-4


def growth(stiffness: float, damping: float, ticks: int = 0, period=T) -> float:
    """1/s, of K on a position some ticks old, D and the lag: roots of a polynomial."""
    decay = math.exp(-period / LAG)
    # v+ = v + T a; w+ = decay w + (1 - decay) v+; p+ = p + b w + (T - b) v+.
    z, b = np.poly1d([1.0, 0.0]), LAG * (1.0 - decay)
    k, d = period / M * stiffness, period / M * damping
    moved = (period - b) * (z - decay) + b * (1.0 - decay)
    motion = (z - 1.0 + d) * (z - 1.0) * (z - decay) * z**ticks + k * moved * z
    return math.log(np.abs(motion.roots).max()) / period


def test_charts_hold_the_growth_of_the_difference_equation():
    """A row a damping or spring, a column a spring or delay in whole ticks."""
    springs, dampings = [1.0, 12.0, 60.0], [0.5, 3.0]
    chart = gain_chart(Scenario(), stiffnesses_n_m=springs, dampings_n_s_m=dampings)
    expected = [[growth(k, d) for k in springs] for d in dampings]
    np.testing.assert_allclose(chart.growth_per_s, expected, atol=1e-6)
    assert chart.stable_share == np.mean(np.array(expected) < 0.0)
    chart = gain_delay_chart(
        Scenario(), delays_s=[0.0, 0.06, 0.1], stiffnesses_n_m=springs
    )
    np.testing.assert_allclose(chart.x, [0.0, 0.05, 0.1])
    expected = [[growth(k, D, n) for n in (0, 2, 4)] for k in springs]
    np.testing.assert_allclose(chart.growth_per_s, expected, atol=1e-6)
    assert chart.today == (0.0, K)


def test_growth_over_the_period_and_none_or_all_stable():
    periods = [0.01, 0.1, 0.3]
    found = poles_against_period(Scenario(), periods_s=periods)
    expected = [growth(K, D, period=period) for period in periods]
    np.testing.assert_allclose(found.growth_per_s, expected, atol=1e-6)
    assert found.longest_stable_s == 0.3
    stiff = poles_against_period(Scenario(), stiffness_n_m=500.0, periods_s=periods)
    assert growth(500.0, D, period=0.01) > 0.0
    assert stiff.longest_stable_s == 0.0


def test_gain_charts_boundary_is_the_contact_limit():
    """At today's damping the chart turns from decay to growth at K_r + K_0."""
    limit = largest_contact_stiffness(Scenario())
    chart = gain_chart(
        Scenario(), stiffnesses_n_m=[0.99 * limit, 1.01 * limit], dampings_n_s_m=[D]
    )
    assert chart.growth_per_s[0, 0] < 0.0 < chart.growth_per_s[0, 1]
    assert chart.today == (K, D)


def test_delay_charts_boundary_is_the_delay_margin_of_the_attraction():
    """K_r = 2 on a position of 0.46 s of age: see the exact delay margin."""
    chart = gain_delay_chart(Scenario(), delays_s=[0.45, 0.475], stiffnesses_n_m=[K])
    assert chart.growth_per_s[0, 0] < 0.0 < chart.growth_per_s[0, 1]


def test_gap_chart_is_the_burst_cycle_of_each_gap():
    scenario = Scenario(law="none")
    point = follow_point(scenario)
    chart = gap_chart(
        scenario, gaps_s=[0.5, 1.5], holds=["robot", "world"], point=point
    )
    for row, hold in enumerate(chart.holds):
        for column, gap in enumerate(chart.gaps_s):
            cycle = burst_cycle(scenario, hold, on_s=0.5, gap_s=gap, point=point)
            assert chart.multiplier[row, column] == pytest.approx(
                cycle.largest, rel=1e-6
            )
    assert chart.longest_stable_s("world") == 1.5
    assert chart.longest_stable_s("robot") == 0.5
    assert chart.today == (1.5, "motion")


def test_root_loci_of_the_attraction_follow_the_cubic():
    """M s^2 (1 + lag s) + D s (1 + lag s) + K... sampled, to a tick's worth."""
    stiffness, damping = root_loci(Scenario(law="none"))
    k = np.argmin(np.abs(stiffness.values - 8.0))
    exact = np.roots([M * LAG, M + D * LAG * 0.0 + LAG * 0.0, D, stiffness.values[k]])
    pair = exact[np.abs(exact) < 5.0]
    for pole in pair:
        assert np.abs(stiffness.poles[k] - pole).min() < 0.06
    assert stiffness.limit == pytest.approx(
        largest_contact_stiffness(Scenario()), rel=0.1
    )
    assert damping.today == D


def test_contact_locus_starts_from_the_slopes_of_the_law():
    """Conventional: K_0 = 9 N/m and D_0 = 0.7 N s/m; the attraction adds 2 N/m."""
    gains = {"conventional": {"stiffness_n_m": 9.0, "damping_n_s_m": 0.7}}
    case = Scenario.model_validate({"law": "conventional", "laws": gains})
    *_, spring, damper = root_loci(case)
    undamped = contact_model(case, 11.0)
    damped = contact_model(case, 11.0, approach_damping_n_s_m=0.7)
    for locus, model in ((spring, undamped), (damper, damped)):
        found = locus.poles_today[np.isfinite(locus.poles_today)]
        np.testing.assert_allclose(found, np.sort_complex(model.s_poles), rtol=1e-6)


def with_tick(tick_s: float) -> Scenario:
    rates = {"microphones": {"frame_s": tick_s}, "ultrasonic": {"period_s": tick_s}}
    return Scenario.model_validate({"law": "none", "tick_s": tick_s} | rates)


@pytest.mark.parametrize("tick_s", [0.0125, 0.05])
def test_conditions_and_delays_count_in_ticks(tick_s):
    assert all(check.mismatches == 0 for check in check_conditions(500, tick_s=tick_s))
    chart = gain_delay_chart(
        with_tick(tick_s), delays_s=[0.0, 0.1], stiffnesses_n_m=[K, 4.0]
    )
    np.testing.assert_allclose(chart.x, [0.0, 0.1])
    # p'' = -(K/M) p(t - 0.1 s) - (D/M) p' with the lag: its rightmost root.
    s = -0.1 + 0.7j
    for _ in range(50):
        left = M * s * s * (1 + LAG * s) + D * s + K * np.exp(-0.1 * s)
        slope = M * (2 * s + 3 * LAG * s * s) + D - 0.1 * K * np.exp(-0.1 * s)
        s -= left / slope
    assert chart.growth_per_s[0, 1] == pytest.approx(s.real, abs=2e-3)


@pytest.mark.parametrize("tick_s", [0.0125, 0.05])
def test_root_loci_pass_through_the_poles_at_other_ticks(tick_s):
    """The poles are those of the difference equation at the scenario's gains."""
    today = root_loci(with_tick(tick_s))[0].poles_today
    assert today.real.max() == pytest.approx(growth(K, D, period=tick_s), abs=1e-6)
