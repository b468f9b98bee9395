"""Gains that meet requirements, against closed forms and against the blocks."""

from __future__ import annotations

import math

import control
import numpy as np
import pytest

from analysis.loops.equilibria import follow_equilibrium
from analysis.loops.open_loops import open_loop
from analysis.stability.attraction_search import (
    attraction_loop,
    gain_figures,
    least_damping,
    recommend_gains,
)
from analysis.stability.requirements import Requirements
from diagrams import load_scenario

ALONE = ["law=none", "obstacles=[]", "source.waypoints_m=[[2, 0]]"]


@pytest.mark.parametrize(("at", "share"), [("actuator", 1e-4), ("sensor", 3e-3)])
def test_loop_is_that_of_the_whole_diagram(at, share):
    # AutoDiff of the built diagram, tracker and odometry included: what hearing says
    # is placed by odometry, so that its tick delays nothing while the source rests.
    # The diagram's integrator takes steps, ours is exact.
    scenario = load_scenario("default", ALONE)
    point = follow_equilibrium(scenario)
    omega = np.geomspace(0.05, 2.5, 20)
    whole = open_loop(point, at, "along").response(omega)[0, 0]
    short = attraction_loop(scenario, at).response(omega)[0, 0]
    np.testing.assert_allclose(short, whole, rtol=share)


def test_loop_without_lag_is_the_closed_form():
    # v+ = v + T a is held, so that p+ = p + T v+: the spring sees no delay,
    # T^2 z/(z - 1)^2, and the damper half a tick of it, T/(z - 1).
    fast = load_scenario(
        "default", ["law=none", "plant.motor_lag_s=1e-5", "integration_step_s=1e-5"]
    )
    omega, T = np.geomspace(0.05, 20.0, 20), 0.025
    z = np.exp(1j * omega * T)
    spring, damper = 2.0 / 3.94 * T * T * z / (z - 1.0) ** 2, T / 3.94 / (z - 1.0)
    found = attraction_loop(fast, "actuator").response(omega)[0, 0]
    np.testing.assert_allclose(found, spring + damper, rtol=1e-3)
    inner = attraction_loop(fast, "sensor").response(omega)[0, 0]
    np.testing.assert_allclose(inner, spring / (1.0 + damper), rtol=1e-3)


def largest_root(spring: float, damper: float, ticks: int) -> float:
    """|z| of a spring on a position some ticks old, a damper, and 50 ms of lag."""
    mass, lag, T = 3.94, 0.05, 0.025
    decay = math.exp(-T / lag)
    # v+ = v + T a; w+ = decay w + (1 - decay) v+; p+ = p + b w + (T - b) v+.
    z, b = np.poly1d([1.0, 0.0]), lag * (1.0 - decay)
    moved = (T - b) * (z - decay) + b * (1.0 - decay)
    motion = (z - 1.0 + T / mass * damper) * (z - 1.0) * (z - decay) * z**ticks
    return float(np.abs((motion + T / mass * spring * moved * z).roots).max())


def test_figures_are_the_worse_of_both_cuts():
    """Of phase and modulus by control, of the rest by the difference equation."""
    scenario = load_scenario("default", [*ALONE, "attraction.damping_n_s_m=3"])
    figures = gain_figures(scenario, Requirements(spare_latency_ticks=2))
    found = []
    for at in ("sensor", "actuator"):
        L = attraction_loop(scenario, at)
        system = control.ss(L.A, L.B, L.C, L.D, dt=L.period_s)
        found.append(control.stability_margins(system, method="frd"))
    _, phase, modulus, _, crossover, _ = np.array(found).T
    # At the actuator the gain is of spring and damper, at the sensor of the spring.
    gain = 10.0 ** (figures.gain_margin_db / 20.0)
    border = largest_root(2.0 * gain, 3.0 * gain, 0), largest_root(2.0 * gain, 3.0, 0)
    assert max(border) == pytest.approx(1.0, abs=1e-8)
    assert figures.phase_margin_deg == pytest.approx(phase.min(), rel=2e-3)
    assert figures.sensitivity_peak == pytest.approx(1.0 / modulus.min(), rel=2e-3)
    delays = np.radians(phase) / crossover
    assert figures.delay_margin_s == pytest.approx(delays.min(), rel=2e-3)
    assert border[0] < border[1], "the sensor's gain margin is the lesser one"
    assert phase[1] < phase[0], "but the actuator's phase margin"
    slowest = -np.log(largest_root(2.0, 3.0, 0)) / 0.025
    assert figures.settling_s == pytest.approx(4.0 / slowest)
    assert figures.contact_radius == pytest.approx(largest_root(2.0, 3.0, 2))
    limit = 2.0 + figures.largest_law_stiffness_n_m
    assert largest_root(limit, 3.0, 0) == pytest.approx(1.0, abs=1e-8)


def test_least_damping_meets_everything_and_less_does_not():
    scenario = load_scenario("default", ["law=conventional"])
    limits = Requirements()
    for K_r in (2.0, 4.0):
        figures = least_damping(scenario, K_r, limits).figures
        assert figures is not None
        assert figures.damping_ratio >= limits.damping_ratio
        assert figures.phase_margin_deg >= limits.phase_margin_deg
        assert figures.gain_margin_db >= limits.gain_margin_db
        assert figures.sensitivity_peak <= limits.sensitivity_peak
        assert figures.disk_margin >= limits.disk_margin
        assert figures.delay_margin_s >= limits.delay_margin_s
        assert figures.contact_radius < 1.0
        assert figures.damping_n_s_m == round(figures.damping_n_s_m, 2)
        less = load_scenario(
            "default",
            [
                "law=conventional",
                f"attraction.stiffness_n_m={figures.stiffness_n_m}",
                f"attraction.damping_n_s_m={0.95 * figures.damping_n_s_m}",
            ],
        )
        below = gain_figures(less, limits)
        assert (
            below.damping_ratio < limits.damping_ratio
            or below.phase_margin_deg < limits.phase_margin_deg
            or below.sensitivity_peak > limits.sensitivity_peak
            or below.disk_margin < limits.disk_margin
        )


def test_conventional_law_needs_more_damping_and_nothing_else():
    """12.3 N/m hold the barrier, and are stable in contact from 1.1 N s/m on."""
    found = recommend_gains(load_scenario("default", ["law=conventional"]))
    assert found.settings == {"attraction.damping_n_s_m": 2.48}
    assert found.command == (
        "phonotaxis simulate default --law conventional "
        "--set attraction.damping_n_s_m=2.48"
    )
    assert found.today.damping_ratio == pytest.approx(0.160, abs=1e-3)
    # D_r v / K_r behind a source at 0.3 m/s.
    assert found.today.following_lag_m == pytest.approx(0.15)
    whole, best = found.whole_loop, found.recommended
    assert whole is not None
    assert best is not None
    assert whole.phase_margin_deg == pytest.approx(best.phase_margin_deg, abs=0.01)
    assert whole.disk_margin == pytest.approx(best.disk_margin, abs=1e-3)
    assert "attraction's loop alone" not in found.advice


def test_active_law_gets_gains_that_meet_every_requirement():
    """Pushed off the source the loop across stands (r + epsilon)/r at any gains."""
    found = recommend_gains(load_scenario("default", ["law=active"]))
    whole, law = found.whole_loop, found.law
    assert whole is not None
    assert law is not None
    assert law.acceptable
    assert law.check("offset behind the source").bound == 0.1
    settings = ["law=active", *(f"{k}={v}" for k, v in found.settings.items())]
    point = follow_equilibrium(load_scenario("default", settings))
    factor = 1.0 + 0.175 / point.source_distance_m
    assert whole.gain_margin_db == pytest.approx(20.0 * np.log10(factor), rel=1e-4)
    assert f"gain margin of {whole.gain_margin_db:.2f} dB" in found.advice
    assert not whole.meets(found.requirements)
    assert whole.weakest == "L at the sensor, across"


def test_gains_that_meet_everything_are_kept():
    settings = ["law=none", "attraction.damping_n_s_m=4"]
    found = recommend_gains(load_scenario("default", settings), springs=(1.0,))
    assert found.settings == {}
    assert found.advice == "The current gains meet all requirements."


def test_long_overshoot_needs_a_longer_follow_distance():
    settings = ["law=none", "attraction.follow_distance_m=0.5"]
    found = recommend_gains(load_scenario("default", settings), springs=(1.0,))
    # 0.39 m of overshoot, half the master robot, and 0.25 m, in steps of 5 cm.
    assert found.settings["attraction.follow_distance_m"] == 0.85


def test_law_that_is_too_stiff_has_no_gains():
    scenario = load_scenario(
        "default", ["law=conventional", "laws.conventional.stiffness_n_m=5000"]
    )
    found = recommend_gains(scenario, springs=(1.0,))
    assert found.choices[0].figures is None
    assert found.recommended is None
    assert found.whole_loop is None
    assert found.command == ""
    assert found.advice.startswith("No gains meet all requirements")


def test_no_spring_is_refused():
    scenario = load_scenario("default", ["attraction.stiffness_n_m=0"])
    with pytest.raises(ValueError, match=r"attraction.stiffness_n_m: .* set it above"):
        recommend_gains(scenario)
