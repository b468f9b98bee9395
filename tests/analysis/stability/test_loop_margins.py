"""Margins against closed forms and python-control."""

from __future__ import annotations

import math

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.stability.equilibria import follow_equilibrium
from analysis.stability.loop_margins import all_margins, loop_margins
from analysis.stability.open_loops import closed, cut_model, open_loop, target_loop
from analysis.stability.operating_points import moving_equilibrium
from diagrams.scenario import Scenario

M, K, D = 3.94, 2.0, 1.0


def test_target_loop_has_the_printed_gains_figures():
    """omega_n 0.712 rad/s, damping ratio 0.178, poles -0.1269 +- 0.7011j."""
    model = target_loop(Scenario(), "sensor")
    poles = np.linalg.eigvals(model.A - model.B @ model.C)
    expected = np.roots([M, D, K])
    np.testing.assert_allclose(np.sort_complex(poles), np.sort_complex(expected))
    assert abs(poles[0].real) == pytest.approx(0.1269, abs=5e-5)
    assert abs(poles[0].imag) == pytest.approx(0.7011, abs=5e-5)


def test_margins_of_the_target_loop():
    """Phase margin 20.19 deg at sensor and actuator; 0.5105 s and 0.479 s."""
    sensor, actuator = (
        loop_margins(target_loop(Scenario(), at)) for at in ("sensor", "actuator")
    )
    assert sensor.phase_margin_deg == pytest.approx(20.19, abs=0.005)
    assert actuator.phase_margin_deg == pytest.approx(20.19, abs=0.005)
    assert sensor.crossover_rad_s == pytest.approx(0.690, abs=5e-4)
    assert sensor.delay_margin_s == pytest.approx(0.5105, abs=5e-5)
    assert actuator.delay_margin_s == pytest.approx(0.479, abs=5e-4)
    # (D s + K)/(M s^2) crosses 1 where M^2 w^4 = D^2 w^2 + K^2.
    squared = (D**2 + math.sqrt(D**4 + 4 * K**2 * M**2)) / (2 * M**2)
    assert actuator.crossover_rad_s == pytest.approx(math.sqrt(squared), rel=1e-9)


@settings(max_examples=15)
@given(
    st.floats(0.2, 30.0), st.floats(0.1, 10.0), st.sampled_from(["sensor", "actuator"])
)
def test_margins_are_those_of_control(stiffness, damping, at):
    gains = {"stiffness_n_m": stiffness, "damping_n_s_m": damping}
    model = target_loop(Scenario.model_validate({"attraction": gains}), at)
    ours = loop_margins(model)
    theirs = control.stability_margins(model.to_control())
    _, phase, modulus, _, crossover, modulus_at = theirs
    assert ours.phase_margin_deg == pytest.approx(phase, rel=1e-6)
    assert ours.crossover_rad_s == pytest.approx(crossover, rel=1e-6)
    if ours.modulus_margin < 0.99:  # else nearest at infinite frequency
        assert ours.modulus_margin == pytest.approx(modulus, rel=1e-6)
        assert ours.modulus_frequency_rad_s == pytest.approx(modulus_at, rel=1e-3)
    assert ours.gain_margin == math.inf  # a second-order loop never reaches -180
    for disk in ours.disks:
        omega = disk.frequency_rad_s * np.geomspace(0.8, 1.25, 401)
        alpha = control.disk_margins(model.to_control(), omega, skew=disk.skew)[0]
        assert disk.alpha <= alpha * (1 + 1e-9)
        assert disk.alpha == pytest.approx(alpha, rel=1e-3)


@settings(max_examples=15)
@given(st.floats(1.1, 20.0))
def test_gain_margin_of_a_known_loop(margin):
    """L = k / (s (s + 1)^2) has gain margin 2 / k at 1 rad/s."""
    from analysis.stability.linear_models import LinearModel

    A = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, -2.0]])
    B, C = np.array([[0.0], [0.0], [2.0 / margin]]), np.array([[1.0, 0.0, 0.0]])
    names = ("a", "b", "c"), ("u",), ("y",)
    found = loop_margins(LinearModel("L", A, B, C, np.zeros((1, 1)), *names))
    assert found.gain_margin == pytest.approx(margin, rel=1e-9)
    assert found.stable


def test_an_unstable_plant_needs_a_least_gain():
    """L = 2 / (s - 1): stable for gains above a half."""
    from analysis.stability.linear_models import LinearModel

    one = np.ones((1, 1))
    model = LinearModel("L", one, one, 2 * one, 0 * one, ("x",), ("u",), ("y",))
    found = loop_margins(model)
    assert found.stable
    assert found.gain_reduction_margin == pytest.approx(0.5, rel=1e-6)
    assert found.gain_margin == math.inf


def test_sampled_margins_are_those_of_control():
    model = open_loop(follow_equilibrium(Scenario(law="none")), "actuator")
    ours = loop_margins(model)
    system = control.ss(model.A, model.B, model.C, model.D, dt=model.period_s)
    _, phase, modulus, _, crossover, _ = control.stability_margins(system, method="frd")
    assert ours.phase_margin_deg == pytest.approx(phase, rel=1e-3)
    assert ours.crossover_rad_s == pytest.approx(crossover, rel=1e-3)
    assert ours.modulus_margin == pytest.approx(modulus, rel=1e-3)


def test_lag_and_latency_eat_margin():
    """At the actuator: half a tick of hold, half of integration, 50 ms of lag."""
    point = follow_equilibrium(Scenario(law="none"))
    real = loop_margins(open_loop(point, "actuator"))
    ideal = loop_margins(target_loop(Scenario(), "actuator"))
    lost = math.radians(ideal.phase_margin_deg - real.phase_margin_deg)
    # Lag acts on the position's share of the force alone, hence less than 50 ms.
    assert 0.0 < lost / real.crossover_rad_s < 0.075
    assert real.stable


@pytest.mark.parametrize("moving", [False, True])
@pytest.mark.parametrize("law", ["none", "active"])
def test_cut_loops_close_to_the_closed_loop(law, moving):
    scenario = Scenario(law=law)
    point = moving_equilibrium(scenario) if moving else follow_equilibrium(scenario)
    whole = point.loop.period_derivatives(point.state, point.time_s).A
    for places in (("sensor",), ("actuator",), ("wheels",), ("sensor", "wheels")):
        cut = cut_model(point, *places)
        np.testing.assert_allclose(closed(cut, cut.input_names).A, whole, atol=1e-10)


@pytest.mark.parametrize("law", ["conventional", "active", "active2017"])
def test_gain_margin_is_where_the_loop_starts_to_grow(law):
    """Scaling L by its gain margin puts a pole on the unit circle."""
    point = follow_equilibrium(Scenario(law=law))
    for found in all_margins(point):
        margins = found.margins
        assert margins.stable
        if math.isfinite(margins.gain_margin):
            model = open_loop(point, found.at, found.direction)
            closed_A = model.A - margins.gain_margin * model.B @ model.C
            assert np.abs(np.linalg.eigvals(closed_A)).max() == pytest.approx(1.0)


def test_several_signals_have_no_margins():
    point = follow_equilibrium(Scenario(law="none"))
    with pytest.raises(ValueError, match=r"2 inputs.*part"):
        loop_margins(cut_model(point, "sensor"))


def test_no_spring_no_target_loop():
    slack = Scenario.model_validate({"attraction": {"stiffness_n_m": 0.0}})
    with pytest.raises(ValueError, match=r"stiffness_n_m"):
        target_loop(slack)
