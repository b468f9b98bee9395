"""Ports of a Drake diagram, and of blocks inside it, by name."""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import InputPortIndex, PortDataType

from systems.framework.input_error import InputError

Kind = Literal["input", "output"]


@dataclass(frozen=True)
class Signal:
    """A vector port of a diagram, or of a block inside it."""

    name: str
    """``port``, or ``block.port`` for a port inside the diagram."""
    where: tuple[int, ...]
    """Indices of the systems inside one another that lead to the block."""
    index: int
    """Index of the port."""
    size: int
    kind: Kind

    @property
    def elements(self) -> list[str]:
        """Names of the elements."""
        if self.size == 1:
            return [self.name]
        return [f"{self.name}[{k}]" for k in range(self.size)]

    def _block(self, system: Any) -> Any:
        for index in self.where:
            system = system.GetSystems()[index]
        return system

    def _port(self, system: Any) -> Any:
        block = self._block(system)
        if self.kind == "input":
            return block.get_input_port(self.index)
        return block.get_output_port(self.index)

    def value(self, system: Any, context: Any) -> NDArray[np.float64]:
        """Returns the present value (size,) of the port.

        If the port is an input without a value, the method raises an ``InputError``.
        """
        port, block = self._port(system), self._block(system)
        own = block.GetMyContextFromRoot(context)
        if self.kind == "input" and not port.HasValue(own):
            raise InputError(
                self.name,
                "has no value; fix it in the context: "
                f"diagram.GetInputPort({self.name!r}).FixValue(context, value)",
            )
        return np.array(port.Eval(own), dtype=float)

    def eval(self, system: Any, context: Any) -> Any:
        """Returns the present value (size,) of the port, float or AutoDiffXd."""
        block = self._block(system)
        return self._port(system).Eval(block.GetMyContextFromRoot(context))

    def fix(self, system: Any, context: Any, value: Any) -> None:
        """Sets the value (size,) of an input port, and cuts it off from its source."""
        block = self._block(system)
        self._port(system).FixValue(block.GetMyMutableContextFromRoot(context), value)


def find_signals(system: Any, wanted: Sequence[Any] | None, kind: Kind) -> list[Signal]:
    """Finds vector ports by name, or all vector ports of the system itself.

    Args:
        system: Drake system.
        wanted: Names ``port`` or ``block.port``, or ports. None: all vector ports of
            the system.
        kind: ``input`` or ``output``.

    Returns:
        The ports, in the order of ``wanted``.

    Raises:
        InputError: A name is not known, or the port is abstract.
    """
    if wanted is None:
        own = ports_of(system, kind)
        return [_signal("", (), port, kind) for port in own if carries_numbers(port)]
    if isinstance(wanted, str):
        wanted = [wanted]
    known = dict(_all_ports(system, kind))
    found = []
    for name in wanted:
        key = name if isinstance(name, str) else _name_of(system, name, kind)
        if key not in known:
            near = difflib.get_close_matches(str(key), known, 1)
            hint = f"did you mean {near[0]!r}?" if near else _list(known)
            raise InputError(f"{kind}s", f"{str(key)!r} is no {kind} port; {hint}")
        where, port = known[key]
        if not carries_numbers(port):
            raise InputError(
                f"{kind}s", f"{key!r} has an abstract value; choose a vector port"
            )
        prefix = key.removesuffix(port.get_name())
        found.append(_signal(prefix, where, port, kind))
    return found


def find_source(system: Any, wanted: Any) -> Any:
    """Finds the output port that feeds an input port inside a diagram.

    Args:
        system: Drake diagram.
        wanted: Name ``block.port`` of the input port, or the port.

    Returns:
        The output port.

    Raises:
        InputError: The input port is not known, or no output port feeds it.
    """
    (signal,) = find_signals(system, [wanted], "input")
    parents = [system]
    for index in signal.where:
        parents.append(parents[-1].GetSystems()[index])
    block, port = parents.pop(), signal.index
    # An input port of an inner diagram passes its value on to ports inside it.
    while parents:
        parent = parents.pop()
        for (to_block, to_port), (of_block, of_port) in parent.connection_map().items():
            if to_block is block and int(to_port) == port:
                return of_block.get_output_port(int(of_port))
        exported = [
            k
            for k in range(parent.num_input_ports())
            for to_block, to_port in parent.GetInputPortLocators(InputPortIndex(k))
            if to_block is block and int(to_port) == port
        ]
        if not exported:
            break
        block, port = parent, exported[0]
    raise InputError(
        "port",
        f"{signal.name!r} is not fed by an output port of the diagram; choose an input "
        "port inside a loop",
    )


def _list(known: dict[str, Any]) -> str:
    return f"it has {', '.join(list(known)[:8])}" if known else "it has none"


def carries_numbers(port: Any) -> bool:
    """Returns whether a port carries numbers; otherwise, it carries an object."""
    return bool(port.get_data_type() == PortDataType.kVectorValued)


def _signal(prefix: str, where: tuple[int, ...], port: Any, kind: Kind) -> Signal:
    name = f"{prefix}{port.get_name()}"
    return Signal(name, where, int(port.get_index()), int(port.size()), kind)


def ports_of(system: Any, kind: Kind) -> list[Any]:
    """Returns the input or output ports of a Drake system, in order."""
    if kind == "input":
        return [system.get_input_port(k) for k in range(system.num_input_ports())]
    return [system.get_output_port(k) for k in range(system.num_output_ports())]


def _all_ports(
    system: Any, kind: Kind, where: tuple[int, ...] = (), prefix: str = ""
) -> Iterator[tuple[str, tuple[tuple[int, ...], Any]]]:
    for port in ports_of(system, kind):
        name = port.get_name()
        yield (f"{prefix}.{name}" if prefix else name), (where, port)
    for index, part in enumerate(
        system.GetSystems() if hasattr(system, "GetSystems") else ()
    ):
        inner = f"{prefix}/{part.get_name()}" if prefix else part.get_name()
        yield from _all_ports(part, kind, (*where, index), inner)


def _name_of(system: Any, port: Any, kind: Kind) -> str | None:
    for name, (_, known) in _all_ports(system, kind):
        if known is port or (
            known.get_system() is port.get_system()
            and known.get_index() == port.get_index()
        ):
            return name
    return None
