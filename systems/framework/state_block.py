"""Blocks that do a ``Step`` whose outputs are in its state alone."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from systems.framework.cache import declare_cache
from systems.framework.finite import read_lists
from systems.framework.step_block import RunFacts, Step


def ticks_of(time_s: float, tick_s: float, least: int = 1) -> int:
    """A time as a number of ticks.

    Args:
        time_s: s.
        tick_s: Period of a tick, s.
        least: Fewest that count.

    Returns:
        The nearest number.
    """
    return max(least, round(time_s / tick_s))


class StateOutputs:
    """Ports, state and events of a block that does such a ``Step``.

    A mix-in beside ``LeafSystem``. No output depends on a present input, so that such
    blocks may stand in a circle.
    """

    def declare_state_outputs(
        self: Any,
        done: Step,
        inputs: Sequence[tuple[str, int]],
        outputs: Sequence[tuple[str, int]],
        tick_s: float,
    ) -> None:
        """Declares all of it.

        Args:
            done: What the block does; it has a ``publish``.
            inputs: Names and sizes of the input ports, in the step's order.
            outputs: The same of the output ports, in that of ``publish``.
            tick_s: Period of the update, s.
        """
        assert done.publish is not None
        self.step, self._tick_s = done, tick_s
        self._sizes = [size for _, size in outputs]
        self._inputs = [
            self.DeclareVectorInputPort(name=name, size=size) for name, size in inputs
        ]
        self.DeclareDiscreteState([*map(float, done.state)])
        self.DeclarePeriodicDiscreteUpdateEvent(
            period_sec=tick_s, offset_sec=0.0, update=self._replace_state
        )
        ticket = {self.xd_ticket()}
        self._told = declare_cache(self, "published", self._published, ticket)
        for index, (name, size) in enumerate(outputs):

            def calc(context: Any, output: Any, index: int = index) -> None:
                output.SetFromVector(self._told.Eval(context)[index])

            self.DeclareVectorOutputPort(
                name=name,
                size=size,
                calc=calc,
                prerequisites_of_calc={self._told.ticket()},
            )

    def step_for(self: Any, run: RunFacts) -> Step:
        """What the block does in each tick of a compiled loop."""
        step: Step = self.step
        return step

    def _published(self: Any, context: Any) -> list[list[float]]:
        state = context.get_discrete_state(0).value().tolist()
        outputs = [[0.0] * size for size in self._sizes]
        self.step.publish(state, outputs, self.step.numbers)
        return outputs

    def _replace_state(self: Any, context: Any, discrete_state: Any) -> None:
        inputs = read_lists(context, self._inputs)
        state = context.get_discrete_state(0).value().tolist()
        tick = round(context.get_time() / self._tick_s)
        self.step.step(tick, state, inputs, (), self.step.numbers)
        discrete_state.set_value(0, np.array(state))
