"""Steps in Python for blocks that work on whole arrays: compiled loops call back.

A frame of sound is read and written by libraries (transforms, room responses), which
compiled code cannot call; a call back costs a microsecond or two.
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

#: Reads the inputs of a tick and fills the outputs of the next, each one after the
#: other as the ports are.
HostFunction = Callable[[int, NDArray[np.float64], NDArray[np.float64]], None]


class HostError(Exception):
    """Ends a compiled loop: a ``HostCall`` keeps what was raised."""


class HostCall:
    """A Python function as compiled code calls it: by its address.

    What it raises cannot pass through compiled code: it is kept in ``error``, and the
    loop ends with ``HostError``. The address is good as long as this object lives.

    Args:
        function: Takes the tick, the inputs and the outputs to be filled.
        inputs: How many numbers its inputs are; the rest are outputs.
    """

    def __init__(self, function: HostFunction, inputs: int) -> None:
        self._function, self._inputs = function, inputs
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
            self._function(tick, inputs, outputs)
        except BaseException as error:  # noqa: BLE001  # raised again after the loop
            self.error = error
            return 1
        return 0


class HostNumbers(NamedTuple):
    """What ``_host_step`` depends on."""

    address: int
    """Of the function."""
    period_ticks: int
    """From one call to the next, ticks."""
    inputs: int
    """Numbers on the input ports."""


def _define_called(_, function, tick, address, size):  # type: ignore[no-untyped-def]
    """What the function of three whole numbers returns that stands at an address."""

    def codegen(_: Any, builder: Any, _signature: Any, values: Any) -> Any:
        word = ir.IntType(64)
        kind = ir.FunctionType(word, [word] * 3)
        pointer = builder.inttoptr(values[0], kind.as_pointer())
        return builder.call(pointer, values[1:])

    return types.int64(*[types.int64] * 4), codegen


_called: Any = intrinsic(_define_called)


def _host_step(tick, state, inputs, outputs, numbers):  # type: ignore[no-untyped-def]
    """Hands the inputs over; the state is they and the outputs of the next tick."""
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
    """The outputs of ``_host_step``'s state."""
    k = numbers.inputs
    for values in outputs:
        for j in range(len(values)):
            values[j] = state[k]
            k += 1


def host_step(
    function: HostFunction, inputs: int, outputs: int, period_ticks: int
) -> Step:
    """A step in Python, whose outputs are zero until it was done for the first time.

    Args:
        function: What is done, see ``HostFunction``.
        inputs: Numbers on the input ports.
        outputs: Numbers on the output ports; they are published for the next tick.
            0: it is done before the blocks that publish for the next tick.
        period_ticks: From one time to the next, ticks.

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
