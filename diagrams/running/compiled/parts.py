"""Compiled functions that a loop calls by their addresses.

A loop that is compiled with all that it calls takes numba long, and has to be compiled
anew for every set of blocks. Called by address, each block is compiled by itself, and
the loop once for all: `run_parts`. A part takes the tick and the address of its words:
whole numbers, and addresses of arrays, which stay where they are.
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

# numba's stubs leave it out.
carray: Any = numba.carray  # type: ignore[attr-defined]

#: A part that is called with this for the tick publishes what its state says.
PUBLISH = -1


def _pointing_at(kind: Any) -> Any:
    """What makes a pointer to numbers of a kind of an address."""

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


#: For each type of number what makes an array of an address and a shape.
ARRAYS: dict[Any, Callable[[int, Any], Any]] = {
    np.dtype(np.float64): _float_array,
    np.dtype(np.float32): _single_array,
    np.dtype(np.int64): _whole_array,
    np.dtype(np.int32): _small_array,
    np.dtype(np.uint64): _large_array,
    np.dtype(np.bool_): _flag_array,
}


def _define_called(_, address, tick, words):  # type: ignore[no-untyped-def]
    """What a part returns; what it raises is raised."""
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
def run_parts(
    begin: int,
    end: int,
    log: Any,
    logged: Any,
    parts: Any,
    plan: Any,
) -> tuple[int, bool]:  # pragma: no cover  (compiled)
    """Goes through ticks.

    Args:
        begin: First tick.
        end: The one after the last.
        log: (ticks, columns) rows to be filled.
        logged: (n, 2) addresses of what is logged, and how many numbers each is.
        parts: (m, 2) addresses of functions and of their words.
        plan: Numbers of the parts that are called at the begin of the run, to publish;
            first in a tick; the one that judges whether the run is over; and (k, 2)
            those before the log and (m, 2) those after it, and whether each is to
            publish.

    Returns:
        The tick after the last one that was logged, and whether the run is over.
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
