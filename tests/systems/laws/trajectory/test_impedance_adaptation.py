"""Sensitivities against differences; adaptation against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from systems.laws.trajectory.impedance_sensitivity import sensitivity_sources
from systems.laws.trajectory.trajectory_adaptive import AdaptiveTrajectoryParameters
from systems.laws.trajectory.trajectory_impedance import target_force
from tests.systems.laws.trajectory.point_robot import TICK_S, along, run

LAW = AdaptiveTrajectoryParameters(rule="sensitivity")
GAINS = ("stiffness_n_m", "damping_n_s_m", "contact_stiffness_n_m")
#: Adapts nothing, and so shows the sensitivities of the nominal loop.
WATCHED = LAW.model_copy(update={"rate": 0.0})


@pytest.mark.parametrize("number", range(3))
@pytest.mark.parametrize("objects", [(), ((1.5, 0.25, 0.0, 0.0),)])
def test_sensitivities_are_those_of_the_motion(number, objects):
    """Against central differences, through a contact with faded damping."""
    name, step = GAINS[number], 1e-5
    offset = (0.0, 0.1, 0.0, 0.0)

    def motion(value):
        law = WATCHED.model_copy(update={name: value})
        return run(along(0.15, 30.0), objects, offset, law=law)

    value = getattr(LAW, name)
    differences = motion(value + step)[:, :4] - motion(value - step)[:, :4]
    expected = differences / (2.0 * step)
    at = 7 + 4 * number
    found = motion(value)[:, at : at + 4]
    # A row has what was learned up to its tick, and so is a tick ahead.
    found = np.vstack([np.zeros(4), found[:-1]])
    if np.abs(expected).max() == 0.0:
        assert not found.any()
        return
    off = np.abs(found - expected).max() / np.abs(expected).max()
    assert off < 1e-3


def test_the_lyapunov_function_of_the_printed_rule_falls():
    """V = w^2 |e|^2/2 + |e_v|^2/2 + (dK^2 + dD^2)/(2 gamma), no obstacle; rtol 1e-9."""
    mass, rate, frequency, ratio = 1.0, 10.0, 2.0, 1.0
    wanted = np.array([mass * frequency**2, 2.0 * ratio * frequency * mass])

    def target(t):
        p_d = math.sin(0.6 * t) + 0.5 * math.sin(1.7 * t)
        v_d = 0.6 * math.cos(0.6 * t) + 0.85 * math.cos(1.7 * t)
        return p_d, 0.0, v_d, 0.0

    def slope(t, x):
        p, v, p_r, v_r, stiffness, damping = x
        at = target(t)
        force = target_force((p, 0.0), (v, 0.0), at, stiffness, damping)[0]
        source = sensitivity_sources((p, 0.0), (v, 0.0), at, [], mass)
        a_r = frequency**2 * (at[0] - p_r) + 2.0 * ratio * frequency * (at[2] - v_r)
        e_v = v - v_r
        return [
            v,
            force / mass,
            v_r,
            a_r,
            -rate * e_v * source.stiffness[0],
            -rate * e_v * source.damping[0],
        ]

    found = solve_ivp(
        slope, (0.0, 400.0), [0, 0, 0, 0, 1.0, 2.0], rtol=1e-9, atol=1e-12, max_step=0.2
    )
    p, v, p_r, v_r, stiffness, damping = found.y
    away = np.array([stiffness, damping]) - wanted[:, None]
    energy = 0.5 * (frequency**2 * (p - p_r) ** 2 + (v - v_r) ** 2)
    energy += np.sum(away**2, axis=0) / (2.0 * rate)
    assert np.diff(energy).max() <= 1e-9 * energy[0]
    np.testing.assert_allclose(found.y[4:, -1], wanted, rtol=0.01)


@pytest.mark.parametrize("rule", ["lyapunov", "sensitivity"])
def test_the_block_learns_what_the_reference_has(rule):
    """From K = 1, D = 2 to M w^2 = 4 and 2 xi w M = 4 in 400 s."""
    changes = {"rule": rule, "rate": 30.0, "stiffness_n_m": 1.0, "damping_n_s_m": 2.0}
    law = LAW.model_copy(update=changes)
    time = np.arange(0.0, 400.0, TICK_S)
    targets = np.zeros((len(time), 4))
    targets[:, 0] = np.sin(0.6 * time) + 0.5 * np.sin(1.7 * time)
    targets[:, 2] = 0.6 * np.cos(0.6 * time) + 0.85 * np.cos(1.7 * time)
    last = run(targets, law=law, poles=(2.0, 1.0))[-1]
    # The loop moves by its velocity of the tick's end, the reference exactly: a tenth.
    np.testing.assert_allclose(last[4:6], [4.0, 4.0], rtol=0.12)


def test_a_constant_push_makes_the_gradient_drift():
    """K(t) = (K_0^4 + 4 gamma F^2 t)^(1/4): without a bound."""
    push, rate = 1.5, LAW.rate
    targets = along(0.0, 6000.0)
    start = (push / 3.0, 0.0, 0.0, 0.0)
    rows = run(targets, start=start, law=LAW, push=(push, 0.0))
    for time in (60.0, 600.0, 6000.0):
        stiffness = rows[round(time / TICK_S) - 1, 4]
        expected = (3.0**4 + 4.0 * rate * push**2 * time) ** 0.25
        assert stiffness == pytest.approx(expected, rel=0.03)
    literal = AdaptiveTrajectoryParameters()
    still = run(targets, start=start, law=literal, push=(push, 0.0))
    assert still[-1, 4] < 4.5


def critical_rate(amplitude):
    """Least rate of the gradient from which K or D leaves every bound in 60 s."""
    time = np.arange(0.0, 60.0, TICK_S)
    targets = np.zeros((len(time), 4))
    targets[:, 0] = np.sin(0.6 * time) + 0.5 * np.sin(1.7 * time)
    targets[:, 2] = 0.6 * np.cos(0.6 * time) + 0.85 * np.cos(1.7 * time)
    targets *= amplitude
    law = LAW.model_copy(update={"stiffness_n_m": 1.0, "damping_n_s_m": 2.0})
    low, high = 1e1 / amplitude**2, 1e5 / amplitude**2
    for _ in range(12):
        rate = math.sqrt(low * high)
        own = law.model_copy(update={"rate": min(rate, 1e6)})
        rows = run(targets, law=own, poles=(2.0, 1.0))
        wild = not np.all(np.abs(rows[:, :6]) < 1e4)
        low, high = (low, rate) if wild else (rate, high)
    return math.sqrt(low * high)


def test_the_critical_rate_falls_with_the_square_of_the_amplitude():
    """The trap of gradient rules: gamma a^2 decides."""
    products = [critical_rate(a) * a**2 for a in (0.05, 0.3, 1.0, 3.0)]
    assert max(products) / min(products) < 2.0


def jammed(law, duration=90.0):
    """Behind a wall at x = 1 that P cannot pass."""
    targets = along(0.15, duration)
    return run(targets, [[1.6, 0.0, 0.0, 0.0]], law=law, held=1.0)


def test_without_limits_a_jam_makes_it_stiff():
    assert jammed(LAW)[-1, 4] > 20.0


def test_limits_hold_in_ten_minutes_of_jam():
    rows = jammed(LAW.model_copy(update={"projected": True}), duration=600.0)
    assert np.all((rows[:, 4] >= 0.5) & (rows[:, 4] <= 6.0))
    assert np.all((rows[:, 5] >= 3.0) & (rows[:, 5] <= 8.0))
    assert rows[:, 4].max() == 6.0
