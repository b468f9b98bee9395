"""Checks values for the ports of a block, and states in messages what to type."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.autodiffutils import AutoDiffXd
from pydrake.common.value import AbstractValue
from pydrake.systems.framework import System_

from analysis.loops.diagram_ports import Kind, carries_numbers, ports_of
from diagrams.scenario.suggestions import did_you_mean
from systems.framework.finite import block_name
from systems.framework.input_error import InputError, shortened

_DUAL = System_[AutoDiffXd]
# Longest list of zeros that a message shows.
_MOST_ZEROS = 9


def input_port(block: Any, name: str) -> Any:
    """Returns the input port with a name.

    Args:
        block: Any Drake system.
        name: Name of the port.

    Returns:
        The port.

    Raises:
        InputError: The block has no input port of this name.
    """
    if block.HasInputPort(name):
        return block.GetInputPort(name)
    raise _unknown(block, "input", name)


def output_port(block: Any, name: str) -> Any:
    """Returns the output port with a name.

    Args:
        block: Any Drake system.
        name: Name of the port.

    Returns:
        The port.

    Raises:
        InputError: The block has no output port of this name.
    """
    if block.HasOutputPort(name):
        return block.GetOutputPort(name)
    raise _unknown(block, "output", name)


def _unknown(block: Any, kind: Kind, name: str) -> InputError:
    known = [port.get_name() for port in ports_of(block, kind)]
    return InputError(
        block_name(block),
        f"has no {kind} port {name!r}{did_you_mean(name, known)}; "
        f"its {kind} ports are {', '.join(known) or 'none'}",
    )


def differentiates(block: Any) -> bool:
    """Whether the numbers of a block are AutoDiffXd."""
    return isinstance(block, _DUAL)


def numbers_of(block: Any, values: Any) -> Any:
    """Returns an array of numbers, of the scalar type of a block.

    Args:
        block: Any Drake system.
        values: Number, or sequence of numbers, floats or AutoDiffXd.

    Returns:
        An array of the shape of ``values``.

    Raises:
        ValueError: The values are not numbers, or their lists differ in length.
        TypeError: The values are not numbers.
    """
    if differentiates(block):
        given = np.asarray(values, dtype=object)
        return np.vectorize(_dual, otypes=[object])(given) if given.size else given
    return np.asarray(values, dtype=float)


def _dual(value: Any) -> AutoDiffXd:
    return value if isinstance(value, AutoDiffXd) else AutoDiffXd(value)


def port_value(block: Any, port: Any, value: Any) -> Any:
    """Checks a value for an input port.

    Args:
        block: The block, for the message.
        port: Input port of the block.
        value: A sequence of numbers, a number for a port with one element, or the
            object that the port carries.

    Returns:
        The value, as Drake takes it.

    Raises:
        InputError: The value is not numeric, or its shape is not that of the port.
    """
    if not carries_numbers(port):
        return _object_value(block, port, value)
    try:
        numbers = np.atleast_1d(numbers_of(block, value))
    except (TypeError, ValueError):
        fault = f"is {shortened(repr(value), 60)}, which is not a list of numbers"
        raise _wrong(block, port, fault) from None
    if numbers.shape != (port.size(),):
        if numbers.ndim == 1:
            fault = f"has {elements(numbers.size)}"
        else:
            fault = f"has the shape {numbers.shape}"
        raise _wrong(block, port, fault)
    return numbers


def _object_value(block: Any, port: Any, value: Any) -> AbstractValue:
    if isinstance(value, AbstractValue):
        return value
    carried: Any = port.Allocate()
    try:
        carried.set_value(value)
    except TypeError:
        kind = type(carried.get_value()).__name__
        raise InputError(
            block_name(block),
            f"{port.get_name()} is {shortened(repr(value), 60)}; it needs an object of "
            f"the class {kind}; write {port.get_name()}={kind}(...)",
        ) from None
    return carried


def _wrong(block: Any, port: Any, fault: str) -> InputError:
    return InputError(
        block_name(block),
        f"{port.get_name()} {fault}; it needs {elements(port.size())}"
        f"{unit_of(block, port)}; write {example(port)}",
    )


def elements(count: int) -> str:
    """Returns a number of elements in words."""
    return f"{count} element{'' if count == 1 else 's'}"


def unit_of(block: Any, port: Any) -> str:
    """Returns the unit of an input port in brackets; empty if the block states none."""
    units = {each.name: each.unit for each in getattr(block, "inputs", ())}
    unit = units.get(port.get_name(), "")
    return f" ({unit})" if unit else ""


def example(port: Any) -> str:
    """Returns a keyword with a value of the right shape, such as ``echo=[0.0, 0.0]``.

    The value of a port that carries an object is ``...``.
    """
    if not carries_numbers(port):
        return f"{port.get_name()}=..."
    zeros = ", ".join(["0.0"] * port.size())
    value = f"[{zeros}]" if port.size() <= _MOST_ZEROS else f"[0.0] * {port.size()}"
    return f"{port.get_name()}={value}"
