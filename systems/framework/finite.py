"""Blocks refuse what is not finite, where they read a port and where they are made.

Comparisons swallow NaN: an echo flag of NaN is no echo, an obstacle at NaN is out of
reach. A sum swallows nothing and costs little, so that each block adds up all that it
reads.
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

# Between a template's name and its scalar in the names of pydrake's classes.
_SCALAR = "_\N{MATHEMATICAL BOLD SCRIPT CAPITAL T}"


def read_list(context: Any, port: Any) -> list[Any]:
    """Values of a vector input port, floats or AutoDiffXd.

    Args:
        context: Of the block.
        port: Vector input port of n elements, connected.

    Returns:
        The n elements, in the port's unit.

    Raises:
        ValueError: An element is not finite; names block, port, element and time.
    """
    values = port.Eval(context).tolist()
    added = sum(values)
    if added - added != 0.0:
        check_port(context, port, values)
    return values


def read_lists(context: Any, ports: Sequence[Any]) -> list[list[Any]]:
    """``read_list`` of several ports, in half the time.

    Args:
        context: Of the block.
        ports: Vector input ports, connected.

    Returns:
        A list of elements for each port.

    Raises:
        ValueError: As ``read_list``.
    """
    values = [port.Eval(context).tolist() for port in ports]
    added = sum(chain.from_iterable(values))
    if added - added != 0.0:
        _check_ports(context, ports, values)
    return values


def read_arrays(context: Any, ports: Sequence[Any]) -> list[Any]:
    """``read_lists`` where arrays are wanted.

    Args:
        context: Of the block.
        ports: Vector input ports, connected.

    Returns:
        (n,) array of each port: of floats, or of AutoDiffXd as objects.

    Raises:
        ValueError: As ``read_list``.
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
    """Refuses a named tuple on an abstract port that holds what is not finite.

    Args:
        context: Of the block, for the time in the message.
        port: Abstract input port that carries the record.
        record: Named tuple of numbers and arrays; integers are finite.

    Raises:
        ValueError: As ``read_list``.
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
    """Sum of (n,) numbers in any order: not finite where one of them is not."""
    out = values.dtype.type(0.0)
    for k in range(values.size):
        out += values[k]
    return out


def check_port(context: Any, port: Any, values: Any, field: str = "") -> None:
    """Says which element of what a port carries is not finite, if one is.

    Args:
        context: Of the block, for the time in the message.
        port: Input port.
        values: What it carries, or one field of that: a number or an array.
        field: Name of the field, with a dot before it; empty: the whole.

    Raises:
        ValueError: An element is not finite; names block, port, element and time.
    """
    block = type(port.get_system()).__name__.partition(_SCALAR)[0]
    time = float_of(context.get_time())
    remedy = "look for the block upstream that made it so"
    check_finite(
        f"{block}: {port.get_name()}{field}",
        values,
        f" at {time:g} s, which is not finite; {remedy}",
    )


def check_finite(name: str, values: Any, end: str = "; give a finite number") -> None:
    """Refuses numbers that are not finite.

    Args:
        name: What they are, and of which block.
        values: A number or an array of them, floats or AutoDiffXd.
        end: How the message goes on: when, and the remedy.

    Raises:
        ValueError: Names the first one that is not finite.
    """
    array = np.asarray(values)
    for place, value in enumerate(array.ravel().tolist()):
        number = float_of(value)
        if not math.isfinite(number):
            index = ", ".join(map(str, np.unravel_index(place, array.shape)))
            element = f"[{index}]" if index else ""
            raise ValueError(f"{name}{element} is {number}{end}")
