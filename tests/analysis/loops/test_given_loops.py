"""Loops that users give, against textbook values and the ``control`` package."""

from __future__ import annotations

import json
import math
import re

import control
import numpy as np
import pytest
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import (
    FirstOrderLowPassFilter,
    Gain,
    Integrator,
    ZeroOrderHold,
)

import phonotaxis
from systems.framework.input_error import InputError


def test_a_textbook_loop():
    # Seiler, Packard and Gahinet (2020), section "Example": symmetric disk margin 0.46
    # at 1.94 rad/s; classical margins 3.6 (11.1 dB) and 29.1 deg.
    loop = control.tf([25.0], [1.0, 10.0, 10.0, 10.0])
    found = phonotaxis.margins(loop)
    disk = phonotaxis.disk_margin(loop)
    assert found.gain_increase_margin == pytest.approx(3.6, abs=0.005)
    assert found.phase_margin_deg == pytest.approx(29.1, abs=0.05)
    assert disk.alpha == pytest.approx(0.46, abs=0.005)
    assert disk.frequency_rad_s == pytest.approx(1.94, abs=0.02)
    # 3.6 is 20 log10(3.6) = 11.1 dB.
    assert re.search(
        r"^gain +3\.6\d* \(\+11\.1\d* dB\) up, no limit down$", str(found), re.MULTILINE
    )
    assert re.search(r"^phase +29\.1\d* deg lag, ", str(found), re.MULTILINE)
    # The gains (2 + alpha) / (2 - alpha) and its inverse.
    assert re.match(r"alpha 0\.458\d*, skew 0: gain 0\.62\d* to 1\.59", str(disk))
    unstable = phonotaxis.margins(control.tf([100.0], [1.0, 10.0, 10.0, 10.0]))
    assert str(unstable).endswith("the closed loop is unstable")


def test_sampled_models_keep_their_period():
    # L = 0.5 / (z - 1): the pole 1 - 0.5 k reaches -1 at k = 4, and |L| = 1 where
    # 2 sin(w T / 2) = 0.5, with a phase of -90 deg - w T / 2.
    loop = control.tf([0.5], [1.0, -1.0], 0.05)
    found = phonotaxis.margins(loop)
    half = math.asin(0.25)
    assert found.gain_increase_margin == pytest.approx(4.0)
    assert found.phase_margin_deg == pytest.approx(90.0 - math.degrees(half))
    assert found.crossover_rad_s == pytest.approx(2.0 * half / 0.05)


def servo(inner: bool):
    """A lag and an integrator with negative feedback, or the lag inside a diagram."""
    builder = DiagramBuilder()
    lag = FirstOrderLowPassFilter(0.5)
    lag.set_name("lag")
    if inner:
        box = DiagramBuilder()
        box.AddSystem(lag)
        box.ExportInput(lag.get_input_port(), "in")
        box.ExportOutput(lag.get_output_port(), "out")
        block = builder.AddNamedSystem("box", box.Build())
    else:
        block = builder.AddSystem(lag)
    integrator = builder.AddNamedSystem("integrator", Integrator(1))
    back = builder.AddNamedSystem("back", Gain(-3.0, 1))
    builder.Connect(block.get_output_port(), integrator.get_input_port())
    builder.Connect(integrator.get_output_port(), back.get_input_port())
    builder.Connect(back.get_output_port(), block.get_input_port())
    return builder.Build()


@pytest.mark.parametrize(
    ("inner", "port"),
    [(False, "lag.u0"), (False, "back.u0"), (True, "box.in"), (True, "box/lag.u0")],
)
def test_a_diagram_is_opened_at_a_port(inner, port):
    diagram = servo(inner)
    context = diagram.CreateDefaultContext()
    loop = phonotaxis.loop_at(diagram, context, port)
    expected = control.tf([3.0], [0.5, 1.0, 0.0])
    for w in (0.3, 2.0, 9.0):
        assert loop.response([w])[0, 0, 0] == pytest.approx(complex(expected(1j * w)))
    found, same = phonotaxis.margins(loop), phonotaxis.margins(expected)
    assert found.phase_margin_deg == pytest.approx(same.phase_margin_deg)


def sampled_servo(late: bool):
    """An integrator, a hold of 20 ms, a gain, and on request a hold of 10 ms."""
    builder = DiagramBuilder()
    integrator = builder.AddNamedSystem("integrator", Integrator(1))
    hold = builder.AddNamedSystem("hold", ZeroOrderHold(0.02, 1))
    gain = builder.AddNamedSystem("gain", Gain(-4.0, 1))
    builder.Connect(integrator.get_output_port(), hold.get_input_port())
    builder.Connect(hold.get_output_port(), gain.get_input_port())
    last = gain
    if late:
        last = builder.AddNamedSystem("late", ZeroOrderHold(0.01, 1))
        builder.Connect(gain.get_output_port(), last.get_input_port())
    builder.Connect(last.get_output_port(), integrator.get_input_port())
    return builder.Build()


def test_a_sampled_loop_has_no_delay_of_its_own():
    diagram = sampled_servo(late=False)
    # The hold passes the position on at once, so that L = 4 * 0.02 / (z - 1). At the
    # input of the hold, the position is read before the update, to the same effect.
    for port in ("integrator.u0", "hold.u"):
        loop = phonotaxis.loop_at(diagram, None, port)
        z = np.exp(1j * 3.0 * 0.02)
        assert loop.response([3.0])[0, 0, 0] == pytest.approx(0.08 / (z - 1.0))


def test_a_signal_that_changes_within_the_period_is_no_cut():
    diagram = sampled_servo(late=True)
    with pytest.raises(InputError, match=r"changes within 0\.02 s"):
        phonotaxis.loop_at(diagram, None, "integrator.u0")
    # At the hold, there is one value per period. The other hold delays by 10 ms.
    loop = phonotaxis.loop_at(diagram, None, "hold.u")
    z = np.exp(1j * 3.0 * 0.02)
    expected = 4.0 * (0.01 + 0.01 / z) / (z - 1.0)
    assert loop.response([3.0])[0, 0, 0] == pytest.approx(expected)


def test_each_function_opens_a_diagram_at_a_port():
    # L = 3 / (s (0.5 s + 1)), as in the test above.
    diagram = servo(inner=False)
    at = {"context": diagram.CreateDefaultContext(), "port": "lag.u0"}
    L = control.tf([3.0], [0.5, 1.0, 0.0])
    crossover = math.sqrt(2.0 * (math.sqrt(10.0) - 1.0))  # w^2 (w^2/4 + 1) = 9
    phase = math.pi / 2.0 - math.atan(0.5 * crossover)
    found = phonotaxis.margins(diagram, **at)
    assert found.phase_lag_margin_deg == pytest.approx(math.degrees(phase))
    late = phonotaxis.margins(diagram, **at, delay_s=0.1)
    expected = math.degrees(phase - 0.1 * crossover)
    assert late.phase_lag_margin_deg == pytest.approx(expected)
    delay = phonotaxis.delay_margin(diagram, **at)
    assert delay.delay_s == pytest.approx(phase / crossover)
    w = np.linspace(0.01, 20.0, 200_001)
    for pause in (0.0, 0.1):
        late_L = L(1j * w) * np.exp(-1j * w * pause)
        nearest = np.abs((1.0 + late_L) / (1.0 - late_L)).min() * 2.0
        disk = phonotaxis.disk_margin(diagram, **at, delay_s=pause)
        assert disk.alpha == pytest.approx(nearest, rel=1e-6)
    # A relay with hysteresis of half width 0.1: -1/N has the imaginary part
    # -pi * 0.1 / 4, and L the imaginary part -3 / (w (1 + w^2/4)).
    relay = control.relay_hysteresis_nonlinearity(1.0, 0.1)
    (cycle,) = phonotaxis.describing_function(diagram, relay, **at).cycles
    found_w = cycle.frequency_rad_s
    assert 3.0 / (found_w * (1.0 + found_w**2 / 4.0)) == pytest.approx(
        math.pi * 0.1 / 4.0
    )
    # Always closed, the map is that of the closed loop.
    bursts = phonotaxis.burst_cycle(diagram, 0.5, 0.0, **at)
    poles = np.roots([0.5, 1.0, 3.0])
    assert bursts.largest == pytest.approx(np.exp(0.5 * poles.real).max())
    family = phonotaxis.robustness(
        lambda p: (p["a"] and diagram, at["context"]), {"a": (1.0, 2.0)}
    )
    assert family.growth_per_s == pytest.approx(poles.real.max())


def test_refusals_name_the_remedy():
    with pytest.raises(InputError, match="is a ndarray; give a control"):
        phonotaxis.margins(np.eye(2))
    with pytest.raises(InputError, match="state dt in s"):
        phonotaxis.margins(control.tf([1.0], [1.0, 0.5], True))
    with pytest.raises(InputError, match=r"port: is missing; .*port='block\.port'"):
        phonotaxis.disk_margin(servo(inner=False))
    with pytest.raises(InputError, match=r"context: is 0\.5, .*only with a Drake"):
        phonotaxis.disk_margin(control.tf([1.0], [1.0, 1.0]), 0.5)
    samples = control.frequency_response(control.tf([1.0], [1.0, 1.0]), [1.0, 2.0])
    with pytest.raises(InputError, match="has no states; give a model"):
        phonotaxis.burst_cycle(samples, 1.0, 1.0)
    with pytest.raises(InputError, match="has no states; give a model"):
        phonotaxis.robustness(lambda p: samples, {"a": (1.0, 2.0)})
    with pytest.raises(InputError, match=r"port: is 'a\.b', but"):
        phonotaxis.margins(samples, port="a.b")
    with pytest.raises(InputError, match="from -1 to 1"):
        phonotaxis.disk_margin(control.tf([1.0], [1.0, 1.0]), skew=3.0)
    builder = DiagramBuilder()
    lag = builder.AddNamedSystem("lag", FirstOrderLowPassFilter(0.5))
    builder.ExportInput(lag.get_input_port(), "u")
    diagram = builder.Build()
    for port in ("u", "lag.u0"):
        with pytest.raises(InputError, match="not fed by an output port"):
            phonotaxis.loop_at(diagram, diagram.CreateDefaultContext(), port)


@pytest.mark.parametrize("kind", ["bode", "nyquist", "nichols"])
def test_the_points_behind_the_margins_are_marked(kind):
    # L = 0.5 / (z - 1): |L| = 1 where 2 sin(w T / 2) = 0.5, with a phase of
    # -90 deg - w T / 2. At the Nyquist frequency, L = -1/4.
    half = math.asin(0.25)
    crossing, end = 2.0 * half / 0.05, math.pi / 0.05
    phase = -90.0 - math.degrees(half)
    unit = np.exp(1j * math.radians(phase))
    expected = {
        "bode": [(end, 0.25), (crossing, 1.0), (end, 0.25)],
        "nyquist": [(-0.25, 0.0), (unit.real, unit.imag), (-0.25, 0.0)],
        "nichols": [(-180.0, -12.04), (phase, 0.0), (-180.0, -12.04)],
    }[kind]
    found = phonotaxis.margins(control.tf([0.5], [1.0, -1.0], 0.05))
    axes = found.plot(kind).axes[0]
    marks = [line for line in axes.get_lines() if ": " in str(line.get_label())]
    texts = [str(mark.get_label()).partition(":")[0] for mark in marks]
    assert texts == ["gain up", "phase", "nearest to -1"]
    points = [
        [float(value) for values in mark.get_data() for value in np.asarray(values)]
        for mark in marks
    ]
    np.testing.assert_allclose(points, expected, rtol=0.01, atol=0.02)


def test_results_of_loops_have_documents():
    process = control.tf([25.0], [1.0, 10.0, 10.0, 10.0])
    for result in (
        phonotaxis.margins(process),
        phonotaxis.disk_margin(process),
        phonotaxis.delay_margin(process),
        phonotaxis.robustness(lambda p: [[-p["a"]]], {"a": (1.0, 2.0)}),
    ):
        document = json.loads(json.dumps(result.document(), allow_nan=False))
        assert len(document) >= 5
    assert document["verdict"] == "stable"
    with pytest.raises(InputError, match=r"kind: is 'bod'; use one of bode, nyquist"):
        phonotaxis.margins(process).plot("bod")  # type: ignore[arg-type]
