"""Makes steps with which a compiled simulation loop calls blocks written in Python.

Blocks that process frames of sound use libraries, for example for Fourier transforms
and room responses. Compiled code cannot call these libraries. Therefore the compiled
simulation loop calls a Python function for each of these blocks. A call takes one or
two microseconds.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from systems.framework.block import Step

#: Type of ``function(tick, inputs, outputs)``. The function reads the inputs of a tick
#: (control period) and fills the outputs of the next tick. Each array contains the
#: elements of all ports, in their order.
HostFunction = Callable[[int, NDArray[np.float64], NDArray[np.float64]], None]


class HostError(Exception):
    """Ends a compiled loop. The ``HostCall`` has the original exception."""


class HostCall:
    """A Python function that compiled code calls by its address.

    An exception cannot pass through compiled code. If the function raises an exception,
    the attribute ``error`` stores it, and the compiled simulation loop ends with
    ``HostError``. The address is valid as long as this object exists.

    Args:
        function: The function, see ``HostFunction``.
        inputs: Number of elements of all input ports. Compiled code passes one array.
            Its first ``inputs`` elements are the inputs, and all others are the
            outputs.
    """

    def __init__(self, function: HostFunction, inputs: int) -> None:
        self.function, self._inputs = function, inputs
        self._seen: tuple[int, Any, Any] = (0, None, None)
        self.error: BaseException | None = None
        kind = ctypes.CFUNCTYPE(ctypes.c_int64, *[ctypes.c_int64] * 3)
        self._callback = kind(self._call)
        self.address = ctypes.cast(self._callback, ctypes.c_void_p).value or 0

    def _call(self, tick: int, address: int, size: int) -> int:
        try:
            _, inputs, outputs = self._seen
            if address != self._seen[0]:
                memory: Any = (ctypes.c_double * size).from_address(address)
                values = np.frombuffer(memory, dtype=np.float64)
                inputs, outputs = values[: self._inputs], values[self._inputs :]
                self._seen = address, inputs, outputs
            self.function(tick, inputs, outputs)
        except BaseException as error:  # noqa: BLE001  # raised again after the loop
            self.error = error
            return 1
        return 0


class HostNumbers(NamedTuple):
    """Constants of ``_host_step``."""

    address: int
    """Address of the function."""
    period_ticks: int
    """Period of the calls, ticks."""
    inputs: int
    """Number of elements of all input ports."""


def _define_called(_, function, tick, address, size):  # type: ignore[no-untyped-def]
    """Calls the function of three integers at an address, and returns its result."""

    def codegen(_: Any, builder: Any, _signature: Any, values: Any) -> Any:
        word = ir.IntType(64)
        kind = ir.FunctionType(word, [word] * 3)
        pointer = builder.inttoptr(values[0], kind.as_pointer())
        return builder.call(pointer, values[1:])

    return types.int64(*[types.int64] * 4), codegen


_called: Any = intrinsic(_define_called)


def _host_step(tick, state, inputs, outputs, numbers):  # type: ignore[no-untyped-def]
    """Calls the function. The state holds the inputs, then the next outputs."""
    if tick % numbers.period_ticks != 0:
        return
    k = 0
    for values in inputs:
        for value in values:
            state[k] = value
            k += 1
    function, state_address = np.int64(numbers.address), np.int64(state.ctypes.data)
    if _called(function, np.int64(tick), state_address, np.int64(state.size)) != 0:
        raise HostError


def _publish_host_step(state, outputs, numbers):  # type: ignore[no-untyped-def]
    """Copies the outputs from the state of ``_host_step``."""
    k = numbers.inputs
    for values in outputs:
        for j in range(len(values)):
            values[j] = state[k]
            k += 1


def host_step(
    function: HostFunction, inputs: int, outputs: int, period_ticks: int
) -> Step:
    """Makes a step that calls a Python function.

    The outputs are zero until the first call is complete.

    Args:
        function: The function, see ``HostFunction``.
        inputs: Number of elements of all input ports.
        outputs: Number of elements of all output ports. They change at the tick
            (control period) after a call. Without outputs, the compiled simulation loop
            calls the function early in a tick, before any block publishes new outputs.
        period_ticks: Time from call to call, ticks.

    Returns:
        The step.
    """
    call = HostCall(function, inputs)
    return Step(
        _host_step,
        HostNumbers(call.address, period_ticks, inputs),
        [0.0] * (inputs + outputs),
        _publish_host_step if outputs else None,
        call,
    )
