"""Blocks whose work is one function: Drake calls it, and so do compiled loops."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from pydrake.common.value import Value

from systems.framework.block import RunFacts as RunFacts, Step as Step
from systems.framework.cache import declare_cache
from systems.framework.finite import read_lists
from systems.framework.noise import tick_noise
from systems.framework.scalar_math import float_of


def reseeded(block: Any, run: RunFacts) -> Step:
    """The step of a block whose numbers have a ``noise``, with that of a run.

    Args:
        block: Has a step, and a name.
        run: Knows the seed.

    Returns:
        What the block does in the run.
    """
    step: Step = block.step
    noise = tick_noise(run.seed_of(block.get_name()))
    return step._replace(numbers=step.numbers._replace(noise=noise))


class StepBlock:
    """Ports, state and events of a block that does a ``Step``.

    A mix-in beside ``LeafSystem_[T]``. Every output is a function of the state and of
    the present inputs.
    """

    def declare_step(
        self: Any,
        scalar: Any,
        done: Step,
        inputs: Sequence[tuple[str, int]],
        outputs: Sequence[tuple[str, int]],
        tick_s: float,
        *,
        unread: Sequence[str] = (),
        carried: Sequence[str] = (),
    ) -> None:
        """Declares all of it.

        Args:
            scalar: float or AutoDiffXd.
            done: What the block does.
            inputs: Names and sizes of the input ports, in the step's order.
            outputs: The same of the output ports.
            tick_s: Period of the update, s.
            unread: Last input ports that it has no use for, and may be left open.
            carried: Abstract input ports; what they carry takes the place of the field
                of that name in the step's numbers.
        """
        self.step = done
        self._zero, self._sizes = scalar(0.0), [size for _, size in outputs]
        self._tick_s = tick_s
        self._inputs = [
            self.DeclareVectorInputPort(name=name, size=size) for name, size in inputs
        ]
        self._read = [port for port in self._inputs if port.get_name() not in unread]
        self._carried = [
            self.DeclareAbstractInputPort(name=name, model_value=Value(object()))
            for name in carried
        ]
        sources = {port.ticket() for port in (*self._read, *self._carried)}
        sources.add(self.time_ticket())
        if done.state:
            self.DeclareDiscreteState([scalar(x) for x in done.state])
            self.DeclarePeriodicDiscreteUpdateEvent(
                period_sec=tick_s, offset_sec=0.0, update=self._replace_state
            )
            sources.add(self.xd_ticket())
        self._done = declare_cache(self, "step", self._do_step, sources)
        for index, (name, size) in enumerate(outputs):

            def calc(context: Any, output: Any, index: int = index) -> None:
                output.SetFromVector(self._done.Eval(context)[0][index])

            self.DeclareVectorOutputPort(
                name=name,
                size=size,
                calc=calc,
                prerequisites_of_calc={self._done.ticket()},
            )

    def step_for(self: Any, run: RunFacts) -> Step:
        """What the block does in each tick of a compiled loop."""
        step: Step = self.step
        names = [port.get_name() for port in self._carried]
        if not names:
            return step
        values = {name: run.carried[name](0) for name in names}
        return step._replace(numbers=step.numbers._replace(**values))

    def _do_step(self: Any, context: Any) -> tuple[Any, Any]:
        """Outputs, and the state of the next tick."""
        step, numbers, initial = self.step[:3]
        if self._carried:
            values = {port.get_name(): port.Eval(context) for port in self._carried}
            numbers = numbers._replace(**values)
        inputs, state = read_lists(context, self._read), []
        inputs += [[]] * (len(self._inputs) - len(inputs))
        if initial:
            state = context.get_discrete_state(0).CopyToVector().tolist()
        outputs = [[self._zero] * size for size in self._sizes]
        tick = round(float_of(context.get_time()) / self._tick_s)
        step(tick, state, inputs, outputs, numbers)
        return outputs, state

    def _replace_state(self: Any, context: Any, discrete_state: Any) -> None:
        discrete_state.set_value(0, np.array(self._done.Eval(context)[1]))
