"""Defines the compiled functions that a compiled loop calls by their addresses.

A part of the loop is a compiled function, for example the step of one block. If numba
compiled the loop together with its parts, it would need a long time for each set of
blocks. Because the loop calls its parts by address, numba compiles each part
separately, and the loop ``run_parts`` only once.

Each part has two arguments: the number of the tick (control period), and the address of
an array of integers, the words of the part. A word is a number or the address of
another array. None of these arrays may move in memory.

This file imports little, so that a change of another file rarely makes the compiled
code of the parts invalid.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, register_jitable

from systems.framework.compiling import njit

# The type stubs of numba lack carray.
carray: Any = numba.carray  # type: ignore[attr-defined]

#: Value of the tick with which a part publishes its state outputs.
PUBLISH = -1


def _pointing_at(kind: Any) -> Any:
    """Makes a numba function that converts an address to a pointer to numbers."""

    @intrinsic
    def pointer(_, address):  # type: ignore[no-untyped-def]
        def codegen(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            pointer = context.get_value_type(signature.return_type)
            return builder.inttoptr(values[0], pointer)

        return types.CPointer(kind)(types.int64), codegen

    return pointer


_float_pointer = _pointing_at(types.float64)
_single_pointer = _pointing_at(types.float32)
_whole_pointer = _pointing_at(types.int64)
_small_pointer = _pointing_at(types.int32)
_large_pointer = _pointing_at(types.uint64)
_flag_pointer = _pointing_at(types.boolean)


@register_jitable
def _float_array(address: int, shape: Any) -> Any:
    return carray(_float_pointer(address), shape)


@register_jitable
def _single_array(address: int, shape: Any) -> Any:
    return carray(_single_pointer(address), shape)


@register_jitable
def _whole_array(address: int, shape: Any) -> Any:
    return carray(_whole_pointer(address), shape)


@register_jitable
def _small_array(address: int, shape: Any) -> Any:
    return carray(_small_pointer(address), shape)


@register_jitable
def _large_array(address: int, shape: Any) -> Any:
    return carray(_large_pointer(address), shape)


@register_jitable
def _flag_array(address: int, shape: Any) -> Any:
    return carray(_flag_pointer(address), shape)


#: Functions that make an array from an address and a shape, by type of number.
ARRAYS: dict[Any, Callable[[int, Any], Any]] = {
    np.dtype(np.float64): _float_array,
    np.dtype(np.float32): _single_array,
    np.dtype(np.int64): _whole_array,
    np.dtype(np.int32): _small_array,
    np.dtype(np.uint64): _large_array,
    np.dtype(np.bool_): _flag_array,
}


def _define_called(_, address, tick, words):  # type: ignore[no-untyped-def]
    """Calls the part at an address and returns its result; passes exceptions on."""
    whole, arguments = types.int64, (types.int64, types.int64)

    def codegen(context: Any, builder: Any, _signature: Any, values: Any) -> Any:
        convention = context.call_conv
        kind = convention.get_function_type(whole, arguments)
        part = builder.inttoptr(values[0], kind.as_pointer())
        status, returned = convention.call_function(
            builder, part, whole, arguments, values[1:]
        )
        with cgutils.if_unlikely(builder, status.is_error):
            convention.return_status_propagate(builder, status)
        return returned

    return whole(whole, *arguments), codegen


_called: Any = intrinsic(_define_called)


@njit(cache=True)
def fill(
    out: Any, places: Any, poses: Any, tick: int
) -> None:  # pragma: no cover  (compiled)
    """Copies poses from the row of a tick; bodies at rest have only one row."""
    row = min(tick, poses.shape[1] - 1)
    for body in range(len(places)):
        for k in range(3):
            out[places[body] + k] = poses[body, row, k]


@njit(cache=True)
def copy(
    out: Any, first: int, values: Any, _tick: int
) -> None:  # pragma: no cover  (compiled)
    """Copies values to the elements of ``out`` from ``first`` on."""
    for k in range(len(values)):
        out[first + k] = values[k]


@njit(cache=True)
def clear(outputs: Any) -> None:  # pragma: no cover  (compiled)
    """Sets all outputs to 0."""
    for k in range(len(outputs)):
        for j in range(len(outputs[k])):
            outputs[k][j] = 0.0


@njit(cache=True)
def run_parts(
    begin: int,
    end: int,
    log: Any,
    logged: Any,
    parts: Any,
    plan: Any,
) -> tuple[int, bool]:  # pragma: no cover  (compiled)
    """Runs ticks (control periods) of a compiled loop.

    A part is a compiled function, for example the step of one block. Some blocks have
    outputs that depend only on their state. At the start of the run, ``run_parts``
    calls the parts that publish these outputs. In each tick, it calls these parts:

    1. the first parts, which compute steps
    2. the judge, which decides whether the run is over
    3. the parts before the log

    It then logs one row. If the run continues, it also calls the parts after the log.

    Args:
        begin: First tick.
        end: One after the last tick.
        log: (ticks, columns) rows to fill.
        logged: (n, 2) address and number of elements of each logged array.
        parts: (m, 2) two addresses for each part: that of the compiled function, and
            that of its array of words (see the module).
        plan: Tuple (begins, first, judge, before, after) with indices of parts.
            ``begins`` lists the parts that publish at the start of the run. ``first``
            lists the first parts of a tick. ``judge`` is one index. ``before`` and
            ``after`` are tables of the parts before and after the log. In each row of a
            table, the first number is the index of a part. The second number is 1 if
            the call publishes outputs, and 0 if it computes a step.

    Returns:
        The tick after the last logged tick, and whether the run is over.
    """
    begins, first, judge, before, after = plan
    if begin == 0:
        for part in begins:
            _called(parts[part, 0], PUBLISH, parts[part, 1])
    for tick in range(begin, end):
        for part in first:
            _called(parts[part, 0], tick, parts[part, 1])
        over = _called(parts[judge, 0], tick, parts[judge, 1]) != 0
        for k in range(len(before)):
            part, at = before[k, 0], PUBLISH if before[k, 1] else tick
            _called(parts[part, 0], at, parts[part, 1])
        column = 0
        for k in range(len(logged)):
            values = _float_array(logged[k, 0], (logged[k, 1],))
            for j in range(len(values)):
                log[tick, column] = values[j]
                column += 1
        if over:
            return tick + 1, True
        for k in range(len(after)):
            part, at = after[k, 0], PUBLISH if after[k, 1] else tick
            _called(parts[part, 0], at, parts[part, 1])
    return end, False
