"""What a block declares once is what Drake, the docstring and the loop have."""

from __future__ import annotations

import inspect
from typing import Any, NamedTuple

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from systems import OBJECT, Block, Port, Step
from systems.framework.block import RunFacts, part_of
from systems.framework.input_error import InputError
from systems.framework.noise import (
    TickNoise,
    standard_normals,
    tick_noise,
    tick_normals,
)

pytestmark = pytest.mark.drake


def sum_step(tick, state, inputs, outputs, numbers):
    """Adds up the input, times a gain."""
    (speed, _), (total,) = inputs, outputs
    total[0] = state[0]
    state[0] += numbers[0] * speed[0]


class Sum(Block):
    """Adds up a speed.

    Latency: a tick.
    """

    part, stage = "sum", "robot"
    inputs = (Port("speed", 1, "m/s"), Port("spare", "2 bodies", "m each"))
    outputs = (Port("total", 1, "m", ("distance",)),)

    def __init__(self, *, tick_s: float = 0.1, bodies: int = 1) -> None:
        super().__init__()
        self.set_name("sum")
        self.declare(
            Step(sum_step, (tick_s,), [0.0]),
            tick_s=tick_s,
            sizes={"bodies": bodies},
            unread=("spare",),
        )


class Seen(NamedTuple):
    """A state of arrays, one of which a port carries."""

    memory: Any
    count: Any


def remember_step(tick, state, inputs, outputs, numbers):
    """Counts how often it is done, and keeps the last value."""
    state.count[0] += 1.0
    state.memory[0] = inputs[0][0]
    outputs[0][0] = state.count[0]


class Memory(Block):
    """Remembers."""

    part = "memory"
    inputs = (Port("value", 1, "1"),)
    outputs = (Port("memory", OBJECT, "Array"), Port("count", 1, "1"))

    def __init__(self) -> None:
        super().__init__()
        self.set_name("memory")
        state = Seen(np.zeros(1), np.zeros(1))
        self.declare(Step(remember_step, (), state), tick_s=0.1)


class Reader(Block):
    """Doubles what the memory has."""

    part = "reader"
    inputs = (Port("memory", OBJECT, "Array"),)
    outputs = (Port("double", 1, "1"),)

    def __init__(self) -> None:
        super().__init__()
        self.set_name("reader")

        def step(tick, state, inputs, outputs, numbers):
            outputs[0][0] = 2.0 * inputs[0][0]

        self.declare(Step(step, ()), tick_s=0.1)


class NoiseNumbers(NamedTuple):
    """Of ``Noisy``."""

    noise: TickNoise


def noisy_step(tick, state, inputs, outputs, numbers):
    """A normal number per tick."""
    outputs[0][0] = tick_normals(numbers.noise, tick, 1, 1)[0, 0]


class Noisy(Block):
    """Publishes noise."""

    part = "noisy"
    outputs = (Port("noise", 1, "1"),)

    def __init__(self) -> None:
        super().__init__()
        self.set_name("noisy")
        self.declare(Step(noisy_step, NoiseNumbers(tick_noise(3))), tick_s=0.1)


RUN = RunFacts(5, 0.1, (0.0, 0.0, 0.0), 0.1, lambda _: 7, {})


def value(block: Any, port: str, context: Any) -> Any:
    """The first element of an output."""
    values: Any = block.GetOutputPort(port).Eval(context)
    return values[0]


def test_ports_columns_and_docstring_come_from_one_declaration():
    block = Sum(bodies=3)
    sizes = [block.get_input_port(k).size() for k in range(block.num_input_ports())]
    assert sizes == [1, 6]
    assert block.GetOutputPort("total").size() == 1
    assert block.columns == {"total": ("distance",)}
    assert (part_of(block), block.stage, part_of(object())) == (
        "sum",
        "robot",
        "controller",
    )
    assert inspect.getdoc(Sum) == (
        "Adds up a speed.\n\n.. pydrake_system::\n\n    name: Sum\n    input_ports:\n"
        "    - speed [m/s]\n    - spare [m each]\n    output_ports:\n"
        "    - total [m]\n\nLatency: a tick."
    )


def test_the_state_is_that_of_the_next_tick():
    """A speed of 2 m/s for 0.5 s: 1 m; the port that is not read stays open."""
    block = Sum()
    simulator = Simulator(block)
    block.GetInputPort("speed").FixValue(simulator.get_mutable_context(), [2.0])
    simulator.AdvanceTo(0.45)
    total = value(block, "total", simulator.get_context())
    assert total == pytest.approx(5 * 0.1 * 2.0)


def test_a_loop_does_the_same_step():
    step = Sum().step_for(RUN)
    state, out = np.array(step.state), np.zeros(1)
    for tick in range(6):
        step.step(tick, state, (np.array([2.0]), ()), (out,), step.numbers)
    assert out[0] == pytest.approx(1.0)


def test_arrays_are_done_once_a_tick_and_carried():
    builder = DiagramBuilder()
    memory, reader = builder.AddSystem(Memory()), builder.AddSystem(Reader())
    builder.Connect(memory.GetOutputPort("memory"), reader.GetInputPort("memory"))
    builder.ExportInput(memory.GetInputPort("value"), "value")
    diagram = builder.Build()
    simulator = Simulator(diagram)
    context = simulator.get_mutable_context()
    diagram.GetInputPort("value").FixValue(context, [4.0])
    for ticks in range(1, 4):
        simulator.AdvanceTo(0.1 * ticks)
        # After the update of this tick, its outputs still hold.
        simulator.AdvancePendingEvents()
        own = memory.GetMyContextFromRoot(simulator.get_context())
        counts = [value(memory, "count", own) for _ in range(3)]
        assert counts == [ticks + 1.0] * 3
    own = reader.GetMyContextFromRoot(simulator.get_context())
    assert value(reader, "double", own) == 8.0


def test_each_run_of_a_loop_has_arrays_of_its_own():
    block = Memory()
    first, second = block.step_for(RUN), block.step_for(RUN)
    first.step(0, first.state, (np.ones(1),), (np.zeros(1),), first.numbers)
    assert first.carries["memory"](0)[0] == 1.0
    assert second.carries["memory"](0)[0] == 0.0


def test_a_run_gives_its_seed_to_the_noise():
    block, out = Noisy(), np.zeros(1)
    step = block.step_for(RUN)
    step.step(4, (), (), (out,), step.numbers)
    assert out[0] == standard_normals((1, 1), 7, 4)[0, 0]
    context = block.CreateDefaultContext()
    context.SetTime(0.4)
    drawn = value(block, "noise", context)
    assert drawn == standard_normals((1, 1), 3, 4)[0, 0]


def test_what_is_not_finite_is_refused():
    block = Sum()
    context = block.CreateDefaultContext()
    block.GetInputPort("speed").FixValue(context, [np.nan])
    with pytest.raises(ValueError, match=r"^Sum: speed\[0\] is nan at 0 s"):
        block.GetOutputPort("total").Eval(context)


def test_a_block_without_a_step_is_not_for_loops():
    class Silent(Block):
        """Says nothing."""

    block = Silent()
    block.set_name("silent")
    with pytest.raises(InputError, match=r"^engine: silent has no step"):
        block.step_for(RUN)
