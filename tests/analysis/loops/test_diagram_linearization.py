"""Linear models of Drake diagrams, against matrices and simulations of other origin."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from pydrake.systems import primitives
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import DiagramBuilder, LeafSystem
from scipy.linalg import expm

from analysis.loops.diagram_linearization import linearize
from systems.framework.input_error import InputError

#: Drake's types of arguments are narrower than what it accepts.
blocks: Any = primitives

#: Sums of powers of 2, so that Drake's times of updates have no rounding errors. Drake
#: makes updates whose times differ by rounding one after the other.
TICK = 1.0 / 128.0
PERIODS = (4.0 * TICK, 6.0 * TICK, 8.0 * TICK, 16.0 * TICK)


class Loop:
    """A random ring of blocks: a continuous one, and others with rates of their own.

    The same blocks are wired as a Drake diagram, and kept as matrices. The input u is
    added to the input of the first block.
    """

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        builder = DiagramBuilder()
        self.blocks: list[tuple[str, Any]] = []
        systems = []
        for number in range(rng.integers(2, 5)):
            # The first block flows, and the second one has a rate of its own.
            kinds = [["flow"], ["sampled", "hold"], ["flow", "sampled", "hold"]]
            kind = rng.choice(kinds[min(number, 2)])
            count = int(rng.integers(1, 4))
            A = rng.normal(size=(count, count))
            B, C = rng.normal(size=(count, 1)), rng.normal(size=(1, count))
            D = np.zeros((1, 1)) if number == 0 else 0.5 * rng.normal(size=(1, 1))
            period = float(rng.choice(PERIODS))
            offset = float(TICK * rng.integers(0, 4))
            if kind == "flow":
                system = blocks.LinearSystem(A, B, C, D)
            elif kind == "sampled":
                A /= max(1.0, np.abs(np.linalg.eigvals(A)).max())
                system, offset = blocks.LinearSystem(A, B, C, D, period), 0.0
            else:
                system = blocks.ZeroOrderHold(period, 1, offset)
                A, B = np.zeros((1, 1)), np.ones((1, 1))
                C, D = np.ones((1, 1)), np.zeros((1, 1))
            systems.append(builder.AddNamedSystem(f"block_{number}", system))
            self.blocks.append((kind, (A, B, C, D, period, offset)))
        adder = builder.AddNamedSystem("sum", blocks.Adder(2, 1))
        builder.Connect(systems[-1].get_output_port(), adder.get_input_port(0))
        builder.ExportInput(adder.get_input_port(1), "u")
        builder.Connect(adder.get_output_port(), systems[0].get_input_port())
        for one, other in itertools.pairwise(systems):
            builder.Connect(one.get_output_port(), other.get_input_port())
        builder.ExportOutput(systems[-1].get_output_port(), "y")
        self.diagram = builder.Build()

    def matrices(self, period_s: float) -> tuple[np.ndarray, ...]:
        """Composes flows (matrix exponentials) and jumps over one period, by hand."""
        flows = [k for k, (kind, _) in enumerate(self.blocks) if kind == "flow"]
        others = [k for k in range(len(self.blocks)) if k not in flows]
        where, start = {}, 0
        for k in (*flows, *others):
            count = len(self.blocks[k][1][0])
            where[k], start = slice(start, start + count), start + count
        n = start
        # Input of each block as a row over (states, u): through the ring.
        rows: dict[int, np.ndarray] = {}

        def output(k: int) -> np.ndarray:
            _, (_, _, C, D, _, _) = self.blocks[k]
            row = np.zeros(n + 1)
            row[where[k]] = C[0]
            return row if D[0, 0] == 0.0 else row + D[0, 0] * rows[k]

        last = len(self.blocks) - 1
        unit = np.zeros(n + 1)
        unit[n] = 1.0
        # The first block has no feedthrough: its output begins the ring.
        for k in range(1, len(self.blocks)):
            rows[k] = output(k - 1)
        rows[0] = output(last) + unit
        flow = np.zeros((n + 1, n + 1))
        for k in flows:
            A, B, *_ = self.blocks[k][1]
            flow[where[k], where[k]] += A
            flow[where[k]] += B @ rows[k][None]
        ticks = round(period_s / TICK)
        total = np.eye(n + 1)
        step = expm(flow * TICK)
        for tick in range(ticks):
            jump = np.eye(n + 1)
            for k in others:
                A, B, _, _, period, offset = self.blocks[k][1]
                late = tick - round(offset / TICK)
                if late >= 0 and late % round(period / TICK) == 0:
                    jump[where[k]] = B @ rows[k][None]
                    jump[where[k], where[k]] += A
            total = step @ jump @ total
        y = output(last)
        return total[:n, :n], total[:n, n:], y[None, :n], y[None, n:]


@pytest.mark.parametrize("seed", range(30))
def test_random_diagrams_with_several_rates_and_offsets(seed):
    loop = Loop(seed)
    context = loop.diagram.CreateDefaultContext()
    loop.diagram.get_input_port().FixValue(context, [0.3])
    found = linearize(loop.diagram, context)
    assert found.model.period_s is not None
    expected = loop.matrices(found.model.period_s)
    for name, matrix in zip("ABCD", expected, strict=True):
        assert getattr(found.model, name) == pytest.approx(matrix, rel=1e-7, abs=1e-8)
    assert found.method == "AutoDiffXd"
    assert found.difference < 1e-7
    assert found.undifferentiated == ()
    again = linearize(loop.diagram, context, differences_only=True)
    assert pytest.approx(expected[0], rel=1e-6, abs=1e-7) == again.model.A


def test_delay_by_state_is_a_chain():
    delay = blocks.DiscreteTimeDelay(0.1, 3, 1)
    context = delay.CreateDefaultContext()
    delay.get_input_port().FixValue(context, [0.0])
    found = linearize(delay, context)
    response = found.model.response([2.0])[0, 0, 0]
    # Drake's block has one sample more than its number of delays, for the input.
    assert response == pytest.approx(np.exp(-1j * 2.0 * 0.1 * 4), abs=1e-12)


def test_continuous_diagrams_have_the_model_that_drake_finds():
    from pydrake.examples import PendulumPlant

    pendulum = PendulumPlant()
    context: Any = pendulum.CreateDefaultContext()
    context.SetContinuousState([0.4, 0.0])
    torque = 0.5 * 9.81 * 1.0 * math.sin(0.4)
    pendulum.get_input_port().FixValue(context, [torque])
    found = linearize(pendulum, context, outputs=["state"])
    drake: Any = blocks.Linearize(pendulum, context)
    assert found.model.period_s is None
    assert pytest.approx(drake.A(), abs=1e-12) == found.model.A
    assert pytest.approx(drake.B(), abs=1e-12) == found.model.B
    sampled = found.sampled(0.1)
    assert pytest.approx(expm(0.1 * drake.A()), abs=1e-12) == sampled.A
    delay = blocks.DiscreteTimeDelay(0.1, 1, 1)
    context = delay.CreateDefaultContext()
    delay.get_input_port().FixValue(context, [0.0])
    with pytest.raises(InputError, match="sampled already"):
        linearize(delay, context).sampled(0.1)
    with pytest.raises(InputError, match="another system"):
        linearize(pendulum, context)


class Nonlinear(LeafSystem):
    """A pendulum with friction that a sampled controller in the same block turns."""

    def __init__(self, period_s: float) -> None:
        super().__init__()
        self.set_name("pendulum")
        self.DeclareVectorInputPort("push", 1)
        self.DeclareContinuousState(2)
        self.DeclareDiscreteState(1)
        self.DeclarePeriodicDiscreteUpdateEvent(period_s, 0.0, self._update)
        self.DeclareVectorOutputPort("angle", 1, self._angle)

    def _angle(self, context: Any, output: Any) -> None:
        output.SetAtIndex(0, context.get_continuous_state_vector().GetAtIndex(0))

    def DoCalcTimeDerivatives(self, context: Any, derivatives: Any) -> None:
        angle, speed = context.get_continuous_state_vector().CopyToVector()
        torque = context.get_discrete_state_vector().GetAtIndex(0)
        push = self.EvalVectorInput(context, 0).GetAtIndex(0)
        derivatives.get_mutable_vector().SetFromVector(
            [speed, -math.sin(angle) - 0.1 * speed + torque + push]
        )

    def _update(self, context: Any, discrete: Any) -> None:
        angle, speed = context.get_continuous_state_vector().CopyToVector()
        discrete.set_value(0, [-3.0 * math.tanh(angle) - speed])


def test_blocks_without_automatic_derivatives_are_stepped():
    pendulum = Nonlinear(0.05)
    context: Any = pendulum.CreateDefaultContext()
    context.SetContinuousState([0.3, -0.2])
    pendulum.get_input_port().FixValue(context, [0.1])
    found = linearize(pendulum, context)
    assert found.method == "differences"
    assert found.difference < 1e-8
    assert [item.where for item in found.undifferentiated] == ["pendulum"]
    assert np.abs(found.drift).max() > 1e-3
    assert "not at an equilibrium" in str(found)
    # A small step, simulated with another integrator, moves the state as A says.
    step = 1e-5

    def after(moved: np.ndarray) -> np.ndarray:
        own: Any = pendulum.CreateDefaultContext()
        own.SetContinuousState(moved[:2])
        own.SetDiscreteState(moved[2:])
        pendulum.get_input_port().FixValue(own, [0.1])
        simulator = Simulator(pendulum, own)
        ApplySimulatorConfig(
            SimulatorConfig(integration_scheme="runge_kutta3", accuracy=1e-11),
            simulator,
        )
        simulator.AdvanceTo(0.05)
        state = own.get_continuous_state_vector().CopyToVector()
        return np.array([*state, *own.get_discrete_state_vector().value()])

    here = np.array([0.3, -0.2, 0.0])
    for column in range(3):
        moved = np.eye(3)[column] * step
        slope = (after(here + moved) - after(here - moved)) / (2.0 * step)
        assert found.model.A[:, column] == pytest.approx(slope, rel=1e-6, abs=1e-6)


def test_a_loop_is_opened_at_an_input_inside():
    builder = DiagramBuilder()
    lag = builder.AddNamedSystem("lag", blocks.FirstOrderLowPassFilter(2.0))
    gain = builder.AddNamedSystem("gain", blocks.Gain(-4.0, 1))
    builder.Connect(lag.get_output_port(), gain.get_input_port())
    builder.Connect(gain.get_output_port(), lag.get_input_port())
    diagram = builder.Build()
    closed = linearize(diagram)
    assert pytest.approx(np.array([[-2.5]])) == closed.model.A
    opened = linearize(diagram, inputs=["lag.u0"], outputs=["gain.y0"])
    loop = opened.state_space()
    assert complex(loop(1j)) == pytest.approx(-4.0 / (1.0 + 2.0j))
    ports = linearize(
        diagram, inputs=[lag.get_input_port()], outputs=[gain.get_output_port()]
    )
    assert pytest.approx(opened.model.D) == ports.model.D
    with pytest.raises(InputError, match=r"did you mean 'lag\.u0'"):
        linearize(diagram, inputs=["lag.U"])


def test_a_switch_is_named_with_block_and_port():
    builder = DiagramBuilder()
    lag = builder.AddNamedSystem("lag", blocks.FirstOrderLowPassFilter(2.0))
    limit = builder.AddNamedSystem("limit", blocks.Saturation([-1.0], [1.0]))
    builder.Connect(lag.get_output_port(), limit.get_input_port())
    builder.ExportInput(lag.get_input_port(), "u")
    builder.ExportOutput(limit.get_output_port(), "y")
    diagram = builder.Build()
    context: Any = diagram.CreateDefaultContext()
    diagram.get_input_port().FixValue(context, [1.0])
    context.SetContinuousState([1.0])
    found = linearize(diagram, context)
    assert [item.where for item in found.undifferentiated] == ["y"]
    assert "lag.x[0]" in found.undifferentiated[0].why
    context.SetContinuousState([0.5])
    assert linearize(diagram, context).undifferentiated == ()


def test_refusals_name_the_remedy():
    lag = blocks.FirstOrderLowPassFilter(2.0)
    lag.set_name("lag")
    with pytest.raises(InputError, match="has no value; fix it"):
        linearize(lag)
    with pytest.raises(InputError, match=r"InputPort\[0\] \(u0\) .* not connected"):
        linearize(lag, inputs=())
    hold = blocks.ZeroOrderHold(0.1, 1, 5.0)
    context = hold.CreateDefaultContext()
    hold.get_input_port().FixValue(context, [0.0])
    with pytest.raises(InputError, match="set the time to 5 s"):
        linearize(hold, context)
    builder = DiagramBuilder()
    for period in (0.1, 0.1 + 1e-9 / 7.0):
        block = builder.AddSystem(blocks.ZeroOrderHold(period, 1))
        builder.ExportInput(block.get_input_port())
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    for k in range(2):
        diagram.get_input_port(k).FixValue(context, [0.0])
    with pytest.raises(InputError, match="common multiple"):
        linearize(diagram, context)
