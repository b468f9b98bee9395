"""Delay margins of loops that users give, against closed forms and simulations."""

from __future__ import annotations

import math

import control
import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import (
    DiscreteTimeDelay,
    Gain,
    Integrator,
    ZeroOrderHold,
)

import phonotaxis
from systems.framework.input_error import InputError


def test_a_continuous_loop_has_the_margin_of_the_textbook():
    # L = 2 / (s - 1): |L| = 1 at sqrt(3) rad/s, phase -120 deg: 60 deg of lag.
    found = phonotaxis.delay_margin(control.tf([2.0], [1.0, -1.0]))
    assert found.delay_s == pytest.approx(math.radians(60.0) / math.sqrt(3.0))
    assert found.frequency_rad_s == pytest.approx(math.sqrt(3.0))
    assert found.period_s is None
    assert "0.6046 s" in str(found)


@pytest.mark.parametrize("gain", [0.05, 0.1, 0.3, 0.9])
def test_whole_periods_of_a_sampled_integrator(gain):
    # Levin and May (1976): x[k+1] = x[k] - a x[k-d] is stable for
    # a < 2 cos(d pi / (2 d + 1)).
    limit = next(
        d for d in range(100) if gain >= 2.0 * math.cos(d * math.pi / (2 * d + 1))
    )
    found = phonotaxis.delay_margin(control.tf([gain], [1.0, -1.0], 0.1))
    assert found.whole_periods
    assert found.delay_s == pytest.approx(0.1 * limit)


def integrator_loop(gain, period, *, delay_s=0.0, sampled_input=False):
    """An integrator behind a hold; its delay has steps of a hundredth of a period."""
    builder = DiagramBuilder()
    plant = builder.AddNamedSystem("plant", Integrator(1))
    hold = builder.AddNamedSystem("hold", ZeroOrderHold(period, 1))
    back = builder.AddNamedSystem("back", Gain(-gain, 1))
    builder.Connect(plant.get_output_port(), hold.get_input_port())
    builder.Connect(hold.get_output_port(), back.get_input_port())
    rate = back.get_output_port()
    if delay_s:
        fine = period / 100.0
        delay = DiscreteTimeDelay(fine, round(delay_s / fine) - 1, 1)
        builder.AddNamedSystem("delay", delay)
        builder.Connect(rate, delay.get_input_port())
        rate = delay.get_output_port()
    builder.Connect(rate, plant.get_input_port())
    return builder.Build()


@pytest.mark.parametrize("gain", [0.4, 1.1])
def test_a_part_of_a_period_counts_where_the_plant_is_continuous(gain):
    # x[k+1] = x[k] - a ((1 - f) x[k-d] + f x[k-d-1]) for a delay of d + f periods.
    def radius(delay):
        late, part = divmod(delay, 1.0)
        polynomial = np.zeros(int(late) + 3)
        polynomial[0], polynomial[1] = 1.0, -1.0
        polynomial[int(late) + 1] += gain * (1.0 - part)
        polynomial[int(late) + 2] += gain * part
        return np.abs(np.roots(polynomial)).max()

    period = 0.2
    found = phonotaxis.delay_margin(
        integrator_loop(gain / period, period), port="plant.u0"
    )
    assert not found.whole_periods
    delay = found.delay_s / period
    assert delay % 1.0 > 0.01
    assert radius(delay) == pytest.approx(1.0, abs=1e-8)
    assert radius(delay - 0.01) < 1.0 < radius(delay + 0.01)
    assert all(radius(d) < 1.0 for d in np.arange(0.0, delay - 0.01, 0.01))


def test_the_simulated_diagram_agrees():
    gain, period = 5.5, 0.2
    margin = phonotaxis.delay_margin(integrator_loop(gain, period), port="plant.u0")

    def growth(delay_s):
        diagram = integrator_loop(gain, period, delay_s=delay_s)
        simulator = Simulator(diagram)
        context = simulator.get_mutable_context()
        context.get_mutable_continuous_state_vector()[0] = 1.0
        sizes = []
        for k in range(1, 400):
            simulator.AdvanceTo(k * period)
            sizes.append(abs(context.get_continuous_state_vector()[0]))
        return max(sizes[300:]) / max(sizes[100:200])

    step = period / 100.0
    assert growth(margin.delay_s - 2.0 * step) < 1.0 < growth(margin.delay_s + 2 * step)


def test_a_sampled_block_reads_whole_periods():
    # The hold reads the plant: the input of the hold may be late by whole periods only.
    found = phonotaxis.delay_margin(integrator_loop(2.0, 0.2), port="hold.u")
    assert found.whole_periods
    # Levin and May with a = 0.4.
    limit = next(d for d in range(9) if 2 * math.cos(d * math.pi / (2 * d + 1)) <= 0.4)
    assert found.delay_s == pytest.approx(0.2 * limit)


def test_what_has_no_delay_margin_is_refused_or_infinite():
    with pytest.raises(InputError, match="unstable without a delay"):
        phonotaxis.delay_margin(control.tf([0.5], [1.0, -1.0]))
    with pytest.raises(InputError, match="port: is missing"):
        phonotaxis.delay_margin(integrator_loop(1.0, 0.1))
    assert phonotaxis.delay_margin(control.tf([0.5], [1.0, 1.0])).delay_s == math.inf
    lag = control.tf([0.5], [1.0, -0.5], 0.1)
    assert phonotaxis.delay_margin(lag * 0.9).delay_s == math.inf
