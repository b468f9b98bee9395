"""Replaces quantities of a robot by given signals, for tests of whole robots."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from pydrake.systems.framework import PortDataType

from diagrams.scenario.suggestions import did_you_mean
from systems.framework.block import OBJECT, Block, Port
from systems.framework.input_error import InputError

#: A function of the time in s that returns the value of a quantity.
Signal = Callable[[float], Any]

# Part of a tick by which a time may differ from the time of the tick.
_ROUNDING = 1e-6


class SignalSource(Block):
    """Publishes a signal, which is constant during each tick (control period).

    Args:
        port: Output port: name of the quantity, number of elements, unit and columns.
        signal: Function of the time in s that returns the value of the quantity.
        tick_s: Control period, s.
    """

    stage = "world"

    def __init__(self, port: Port, signal: Signal, tick_s: float) -> None:
        super().__init__()
        self.set_name(f"signal_{port.name}")
        named: Any = self  # other blocks state their part in the class
        named.part, self.outputs = self.get_name(), (port,)
        self.declare_ports()

        def calc(context: Any, output: Any) -> None:
            time_s = math.floor(context.get_time() / tick_s + _ROUNDING) * tick_s
            value = signal(time_s)
            if port.size == OBJECT:
                output.set_value(value)
            elif len(value) == port.size:
                output.SetFromVector(value)
            else:
                raise InputError(
                    f"signal {port.name}",
                    f"has {len(value)} elements at {time_s:g} s; it needs {port.size} "
                    f"({port.unit})",
                )

        self.declare_output(port.name, calc, {self.time_ticket()})


def signal_sources(
    blocks: Iterable[Any], signals: Mapping[str, Signal], tick_s: float
) -> list[SignalSource]:
    """Makes the blocks that publish signals in place of quantities of a robot.

    Args:
        blocks: Blocks of the robot.
        signals: Signals by name of the quantity, which is the name of its ports.
        tick_s: Control period, s.

    Returns:
        One block per signal. If a block of the robot publishes the quantity, the new
        block has the same columns in the table of a run.

    Raises:
        InputError: No block reads a quantity.
    """
    read, published = dict[str, Any](), dict[str, Port]()
    for block in blocks:
        for index in range(block.num_input_ports()):
            port = block.get_input_port(index)
            read[port.get_name()] = port
        for each in getattr(block, "outputs", ()):
            columns = block.columns.get(each.name, ())
            published[each.name] = each._replace(columns=columns)
        for each in getattr(block, "inputs", ()):
            published.setdefault(each.name, each._replace(columns=()))
    sources = []
    for name, signal in signals.items():
        if name not in read:
            raise InputError(
                f"signal {name}",
                f"no block of the robot reads this{did_you_mean(name, read)}; the "
                f"blocks read {', '.join(sorted(read))}",
            )
        vector = read[name].get_data_type() == PortDataType.kVectorValued
        known = published.get(name, Port(name, OBJECT, ""))
        size = read[name].size() if vector else OBJECT
        sources.append(SignalSource(known._replace(size=size), signal, tick_s))
    return sources
