"""Computed delay margins against the simulated diagram."""

from __future__ import annotations

import math

import pytest

from analysis.loops.delay_margin import DELAY_PLACES, DelayedLoop
from analysis.loops.delayed_run import check_delay_margin, simulate_delayed
from diagrams.scenario.scenario import Scenario
from tests.operating_points import follow_point

T = 0.025


def rest(law="none", hold="motion"):
    scenario = {"law": law, "tracker": {"hold": hold}}
    return follow_point(Scenario.model_validate(scenario))


@pytest.mark.slow
@pytest.mark.parametrize("at", DELAY_PLACES)
@pytest.mark.parametrize("delay", [0.0, 0.06, 0.3])
def test_simulated_growth_and_frequency_are_the_computed_ones(at, delay):
    """Within 2 % of frequency and damping: a small step, the all-ideal build."""
    point = rest("conventional", "world")
    loop = DelayedLoop(point, at)
    run = simulate_delayed(point, at, delay, duration_s=40.0)
    growth = math.log(loop.spectral_radius(delay)) / T
    assert run.growth_per_s == pytest.approx(growth, rel=5e-3)
    assert run.frequency_rad_s == pytest.approx(
        loop.critical_frequency(delay), rel=1e-3
    )


@pytest.mark.slow
def test_simulation_across_the_line_agrees_too():
    point = rest("active")
    loop = DelayedLoop(point, "wheels", "across")
    run = simulate_delayed(point, "wheels", 0.2, direction="across", duration_s=60.0)
    growth = math.log(loop.spectral_radius(0.2)) / T
    assert run.growth_per_s == pytest.approx(growth, rel=0.02)


@pytest.mark.long
@pytest.mark.parametrize("at", DELAY_PLACES)
def test_simulation_over_300_s_confirms_the_margin(at):
    """Decays at 0.95 of the margin, grows at 1.05."""
    check = check_delay_margin(rest("none"), at, duration_s=300.0)
    assert check.confirmed
    loop = DelayedLoop(rest("none"), at)
    for run in (check.below, check.above):
        growth = math.log(loop.spectral_radius(run.delay_s)) / T
        assert run.growth_per_s == pytest.approx(growth, rel=0.02)
