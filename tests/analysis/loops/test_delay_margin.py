"""Delay margins: closed forms, another model, and the simulated diagram."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from analysis.loops.delay_margin import (
    DELAY_PLACES,
    DelayedLoop,
    delay_margin,
)
from analysis.loops.delayed_run import (
    check_delay_margin,
    fitted_oscillation,
    simulate_delayed,
)
from analysis.loops.ideal_loop import ideal_loop
from analysis.loops.ideal_scenarios import ideal_scenario
from analysis.loops.operating_points import moving_equilibrium, resting_equilibrium
from diagrams.scenario.scenario import Scenario
from tests.operating_points import follow_point

M, K, D, LAG, T = 3.94, 2.0, 1.0, 0.05, 0.025


def rest(law="none", hold="motion", **data):
    data = {"law": law, "tracker": {"hold": hold}} | data
    return follow_point(Scenario.model_validate(data))


def continuous_margin() -> float:
    """Of K / (s (M s (1 + lag s) + D (1 + lag s)...)): lag acts on the motion alone."""

    def size(w: float) -> float:
        return abs(loop(w)) - 1.0

    def loop(w: float) -> complex:
        s = 1j * w
        return K / (s * (M * s + D) * (1 + LAG * s))

    w = brentq(size, 0.1, 2.0)
    return (np.angle(-loop(w)) % math.tau) / w


def test_wheels_margin_is_the_continuous_one_less_half_a_tick_of_hold():
    margin = delay_margin(rest(), "wheels")
    # The integration of v_P with the newest acceleration gives half a tick back.
    assert margin.delay_s == pytest.approx(continuous_margin(), abs=0.002)


@pytest.mark.parametrize("hold", ["motion", "world"])
@pytest.mark.parametrize("at", DELAY_PLACES)
def test_a_delay_of_nothing_changes_nothing(at, hold):
    point = rest("active", hold)
    loop = DelayedLoop(point, at, "along")
    slowest = max(abs(mode.z) for mode in point.modes)
    assert loop.spectral_radius(0.0) == pytest.approx(slowest, abs=1e-6)


@pytest.mark.parametrize("at", DELAY_PLACES)
def test_radius_is_continuous_in_the_delay_across_ticks(at):
    """A whole tick by either formula: n ticks, or n - 1 and all of one."""
    loop = DelayedLoop(rest("active"), at)
    for ticks in (1, 2, 7):
        below = loop.spectral_radius(ticks * T - 1e-10)
        above = loop.spectral_radius(ticks * T + 1e-10)
        assert below == pytest.approx(above, abs=2e-6)


@pytest.mark.parametrize("direction", ["along", "across"])
@pytest.mark.parametrize("at", DELAY_PLACES)
def test_margin_separates_decay_from_growth(at, direction):
    point = rest("active")
    margin = delay_margin(point, at, direction)
    loop = DelayedLoop(point, at, direction)
    assert loop.spectral_radius(0.99 * margin.delay_s) < 1.0
    assert loop.spectral_radius(1.01 * margin.delay_s) > 1.0


def test_what_swings_without_a_delay_has_no_margin():
    """K_r = 30 N/m: beyond 20.2 N/m lag and sampling leave no damping of 1 N s/m."""
    stiff = Scenario.model_validate(
        {"law": "none", "attraction": {"stiffness_n_m": 30}}
    )
    point = resting_equilibrium(ideal_loop(ideal_scenario(stiff)), np.array([0.8, 0.0]))
    with pytest.raises(ValueError, match="wheels, along: the loop is unstable without"):
        delay_margin(point, "wheels")


def test_no_loop_has_any_delay_margin():
    """Without a push nothing pulls P to the side."""
    assert delay_margin(rest("none"), "wheels", "across").delay_s == math.inf


@pytest.mark.parametrize(("sigma", "omega"), [(-0.05, 0.7), (0.02, 0.9), (0.0, 0.3)])
def test_fit_finds_the_oscillation_that_was_put_in(sigma, omega):
    t = np.arange(0.0, 100.0, T)
    growth, frequency = fitted_oscillation(
        t, 1e-3 * np.exp(sigma * t) * np.sin(omega * t)
    )
    assert growth == pytest.approx(sigma, abs=1e-5)
    assert frequency == pytest.approx(omega, rel=1e-4)


def test_unstable_and_moving_points_are_refused():
    point = moving_equilibrium(Scenario(law="none"))
    with pytest.raises(ValueError, match=r"moves.*find_equilibria"):
        simulate_delayed(point, "wheels", 0.1, duration_s=1.0)
    with pytest.raises(ValueError, match="delay_s"):
        simulate_delayed(rest(), "wheels", -0.1, duration_s=1.0)
    with pytest.raises(ValueError, match="no delay makes"):
        check_delay_margin(rest(), "wheels", "across")
