"""Wires from output ports to input ports, also through nested diagrams."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from pydrake.systems.framework import Diagram
from pydrake.systems.primitives import VectorLogSink


@dataclass(frozen=True)
class Wire:
    """A wire from an output port of one block to an input port of another block.

    All fields are names of blocks and ports.
    """

    source: str
    output: str
    target: str
    input: str


def blocks(diagram: Diagram, *, flat: bool = True) -> list[Any]:
    """Returns the systems of a diagram, except logs, in the order of the diagram.

    A system whose outputs only go to logs is also left out. If the result is flat, a
    nested diagram is replaced by the systems that it contains.
    """
    systems = list(_systems(diagram, flat=flat))
    logs = {s.get_name() for s in systems if isinstance(s, VectorLogSink)}
    readers: dict[str, set[str]] = {}
    for wire in _all_wires(diagram, flat=flat):
        readers.setdefault(wire.source, set()).add(wire.target)
    while more := {name for name, by in readers.items() if by <= logs} - logs:
        logs |= more
    return [s for s in systems if s.get_name() not in logs]


def wires(diagram: Diagram, *, flat: bool = True) -> list[Wire]:
    """Returns all wires between the systems that ``blocks`` returns.

    The wires are sorted by target block, input port, and source block.
    """
    names = [block.get_name() for block in blocks(diagram, flat=flat)]
    found = [wire for wire in _all_wires(diagram, flat=flat) if wire.target in names]
    return sorted(found, key=lambda w: (names.index(w.target), w.input, w.source))


def _systems(diagram: Diagram, *, flat: bool) -> Iterator[Any]:
    for system in diagram.GetSystems():
        if flat and isinstance(system, Diagram):
            yield from _systems(system, flat=True)
        else:
            yield system


def _all_wires(diagram: Diagram, *, flat: bool) -> list[Wire]:
    found = []
    for entry, exit_ in diagram.connection_map().items():
        writer, output = _writer(*exit_) if flat else exit_
        for reader, index in _readers(*entry) if flat else [entry]:
            found.append(
                Wire(
                    writer.get_name(),
                    writer.get_output_port(output).get_name(),
                    reader.get_name(),
                    reader.get_input_port(index).get_name(),
                )
            )
    for system in diagram.GetSystems() if flat else []:
        if isinstance(system, Diagram):
            found += _all_wires(system, flat=True)
    return found


def _writer(system: Any, index: Any) -> tuple[Any, Any]:
    """Returns the block and its output port behind an output port of a diagram."""
    while isinstance(system, Diagram):
        system, index = system.get_output_port_locator(index)
    return system, index


def _readers(system: Any, index: Any) -> Iterator[tuple[Any, Any]]:
    """Yields the blocks and their input ports behind an input port of a diagram."""
    if not isinstance(system, Diagram):
        yield system, index
        return
    for inner in system.GetInputPortLocators(index):
        yield from _readers(*inner)
