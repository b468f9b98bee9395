"""What Drake itself costs: a scenario's diagram with nothing in its blocks.

Each block is a Python leaf with the ports, states, events and dependencies of the
real one. It reads each of its inputs once a tick and answers with zeros: no diagram of
Python blocks with this wiring is faster.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import (
    BasicVector,
    DiagramBuilder,
    LeafSystem,
    PortDataType,
)
from pydrake.systems.primitives import LogVectorOutput, Multiplexer

from diagrams import SoundFollower
from diagrams.building.robot import connect_by_name
from systems.framework.block import part_of


class _Hollow(LeafSystem):
    """A block with the ports, states and events of another, and nothing else."""

    def __init__(self, block: Any) -> None:
        super().__init__()
        self.set_name(block.get_name())
        self.part, self.columns = part_of(block), getattr(block, "columns", {})
        self._inputs = [
            self._input(block.get_input_port(k)) for k in range(block.num_input_ports())
        ]
        state = block.CreateDefaultContext()
        self._groups = [
            np.zeros(state.get_discrete_state(k).size())
            for k in range(state.num_discrete_state_groups())
        ]
        groups = [self.DeclareDiscreteState(zeros) for zeros in self._groups]
        self._rates = np.zeros(state.num_continuous_states())
        if len(self._rates):
            self.DeclareContinuousState(BasicVector(self._rates))
        timing = block.GetUniquePeriodicDiscreteUpdateAttribute()
        self._updates = timing is not None
        if timing is not None:
            self.DeclarePeriodicDiscreteUpdateEvent(
                timing.period_sec(), timing.offset_sec(), self._update
            )
        for k in range(block.num_output_ports()):
            port = block.get_output_port(k)
            read = [
                entry
                for index, entry in enumerate(self._inputs)
                if block.HasDirectFeedthrough(index, k)
            ]
            if not read and k < len(groups) and port.size() == len(self._groups[k]):
                self.DeclareStateOutputPort(port.get_name(), groups[k])
            else:
                self._output(port, read)

    def _input(self, port: Any) -> Any:
        if port.get_data_type() == PortDataType.kAbstractValued:
            return self.DeclareAbstractInputPort(port.get_name(), Value(object()))
        return self.DeclareVectorInputPort(port.get_name(), port.size())

    def _output(self, port: Any, read: list[Any]) -> None:
        tickets = {each.ticket() for each in read}
        tickets.add(self.xc_ticket() if len(self._rates) else self.xd_ticket())
        if not read:
            tickets.add(self.time_ticket())
        # Else the update reads them, once for all outputs.
        if self._updates or int(port.get_index()) > 0:
            read = []
        if port.get_data_type() == PortDataType.kAbstractValued:
            answer: Any = ()
        else:
            answer = np.zeros(port.size())

        def calc(context: Any, output: Any) -> None:
            for each in read:
                each.Eval(context)
            output.set_value(answer)

        if isinstance(answer, tuple):
            alloc = lambda: Value(object())  # noqa: E731
            self.DeclareAbstractOutputPort(port.get_name(), alloc, calc, tickets)
        else:
            self.DeclareVectorOutputPort(port.get_name(), port.size(), calc, tickets)

    def _update(self, context: Any, discrete_state: Any) -> None:
        for each in self._inputs:
            each.Eval(context)
        for group, zeros in enumerate(self._groups):
            discrete_state.set_value(group, zeros)

    def DoCalcTimeDerivatives(self, context: Any, derivatives: Any) -> None:
        for each in self._inputs:
            each.Eval(context)
        derivatives.SetFromVector(self._rates)


def hollow_diagram(follower: SoundFollower, *, log: bool = False) -> Any:
    """The diagram of one robot and one source, with nothing in its blocks.

    Args:
        follower: The built scenario.
        log: Whether to log as it does.

    Returns:
        The diagram.
    """
    (robot,), (source,) = follower.robots.values(), follower.sources.values()
    real = [*source.blocks.values(), follower.obstacles, *robot.blocks.values()]
    blocks = {block.get_name(): _Hollow(block) for block in real}
    builder = DiagramBuilder()
    for name, block in blocks.items():
        builder.AddNamedSystem(name, block)
    connect_by_name(builder, [*blocks.values()])
    if log:
        ports = [
            blocks[robot.blocks[part].get_name()].GetOutputPort(port)
            for part, port in robot.logged
        ]
        multiplexer = builder.AddSystem(Multiplexer([port.size() for port in ports]))
        for index, port in enumerate(ports):
            builder.Connect(port, multiplexer.get_input_port(index))
        LogVectorOutput(
            multiplexer.get_output_port(0), builder, follower.scenario.tick_s
        )
    return builder.Build()
