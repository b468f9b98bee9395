"""Checks that all inputs and arguments of blocks are finite.

A comparison with NaN is false, so a NaN can go unnoticed. For example, an echo flag of
NaN looks like no echo, and an obstacle at NaN looks out of reach. Each block therefore
sums all values that it reads, which takes little time. The sum is finite only if all
values are finite.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from systems.framework.compiling import njit
from systems.framework.scalar_math import float_of

# Text between the template and the scalar type in the names of pydrake's classes.
_SCALAR = "_\N{MATHEMATICAL BOLD SCRIPT CAPITAL T}"


def block_name(system: Any) -> str:
    """Returns the name of a block's class, for messages.

    The name does not contain the scalar type. For a diagram, it is the name of the
    diagram.
    """
    name = type(system).__name__.partition(_SCALAR)[0]
    return system.get_name() or name if name == "Diagram" else name


def read_list(context: Any, port: Any) -> list[Any]:
    """Reads a vector input port and checks that its elements are finite.

    Args:
        context: Context of the block.
        port: Connected vector input port with n elements.

    Returns:
        The n elements, floats or AutoDiffXd, in the unit of the port.

    Raises:
        ValueError: An element is not finite. The message names the block, the port, the
            element and the time.
    """
    values = port.Eval(context).tolist()
    added = sum(values)
    if added - added != 0.0:
        check_port(context, port, values)
    return values


def read_lists(context: Any, ports: Sequence[Any]) -> list[list[Any]]:
    """Reads several vector input ports like ``read_list``, in half of the time.

    Args:
        context: Context of the block.
        ports: Connected vector input ports.

    Returns:
        One list of elements per port.

    Raises:
        ValueError: An element is not finite.
    """
    values = [port.Eval(context).tolist() for port in ports]
    added = sum(chain.from_iterable(values))
    if added - added != 0.0:
        _check_ports(context, ports, values)
    return values


def read_arrays(context: Any, ports: Sequence[Any]) -> list[Any]:
    """Reads several vector input ports as arrays and checks that they are finite.

    Args:
        context: Context of the block.
        ports: Connected vector input ports.

    Returns:
        One (n,) array per port, of floats or of AutoDiffXd objects.

    Raises:
        ValueError: An element is not finite.
    """
    arrays = [port.Eval(context) for port in ports]
    added = sum(chain.from_iterable(map(np.ndarray.tolist, arrays)))
    if added - added != 0.0:
        _check_ports(context, ports, arrays)
    return arrays


def _check_ports(context: Any, ports: Sequence[Any], values: Sequence[Any]) -> None:
    for port, elements in zip(ports, values, strict=True):
        check_port(context, port, elements)


def check_record(context: Any, port: Any, record: Any) -> None:
    """Checks that all fields of a named tuple from an abstract port are finite.

    Args:
        context: Context of the block, for the time in the message.
        port: Abstract input port that carries the named tuple.
        record: Named tuple of numbers and arrays. Arrays of integers are not checked.

    Raises:
        ValueError: A field is not finite.
    """
    for name, field in zip(record._fields, record, strict=True):
        if isinstance(field, np.ndarray):
            finite = field.dtype.kind in "iu" or math.isfinite(total(field.ravel()))
        else:
            finite = math.isfinite(field)
        if not finite:
            check_port(context, port, field, f".{name}")


@njit(cache=True)
def total(values: NDArray[Any]) -> float:  # pragma: no cover  (compiled)
    """Sums (n,) numbers. The sum is not finite if one of the numbers is not."""
    out = values.dtype.type(0.0)
    for k in range(values.size):
        out += values[k]
    return out


def check_port(context: Any, port: Any, values: Any, field: str = "") -> None:
    """Checks that a value from a port is finite.

    Args:
        context: Context of the block, for the time in the message.
        port: Input port that carries the value.
        values: The value of the port or of one of its fields: a number or an array.
        field: ``.name`` if ``values`` is the field ``name`` of the value of the port;
            otherwise empty.

    Raises:
        ValueError: An element is not finite. The message names the block, the port, the
            element and the time.
    """
    block = block_name(port.get_system())
    time = float_of(context.get_time())
    remedy = "look for the block upstream that made it so"
    check_finite(
        f"{block}: {port.get_name()}{field}",
        values,
        f" at {time:g} s, which is not finite; {remedy}",
    )


def check_finite(name: str, values: Any, end: str = "; give a finite number") -> None:
    """Checks that numbers are finite.

    Args:
        name: Name of the block and of the quantity, for the message.
        values: A number or an array of numbers, floats or AutoDiffXd.
        end: End of the message, which states the remedy.

    Raises:
        ValueError: A number is not finite. The message shows the first such number.
    """
    array = np.asarray(values)
    for place, value in enumerate(array.ravel().tolist()):
        number = float_of(value)
        if not math.isfinite(number):
            index = ", ".join(map(str, np.unravel_index(place, array.shape)))
            element = f"[{index}]" if index else ""
            raise ValueError(f"{name}{element} is {number}{end}")
