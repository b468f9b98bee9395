"""Evaluates a block once, or simulates it over time."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.loops.diagram_ports import carries_numbers, ports_of
from phonotaxis.testing.bench import Bench
from phonotaxis.testing.ports import (
    input_port,
)
from systems.framework.finite import block_name
from systems.framework.input_error import InputError


def evaluate(
    block: Any,
    /,
    *,
    time_s: float = 0.0,
    state: Any = None,
    outputs: Iterable[str] | None = None,
    **inputs: Any,
) -> dict[str, Any]:
    """Evaluates the outputs of a block at one time.

    Args:
        block: Any Drake system, for example a block of phonotaxis, or your own block.
            It must not be part of a diagram.
        time_s: Time, s.
        state: State of the block: numbers, continuous state first, or the named tuple
            of the block. None: the initial state.
        outputs: Names of the output ports to evaluate. None: all of them.
        **inputs: Values of the input ports by name: n numbers for a port with n
            elements, one number for a port with one element, or the object that the
            port carries. An input may be omitted if no evaluated output needs it.

    Returns:
        Value of each output port by name: an (n,) array, or the object that the port
        carries. The values have the units of the ports.

    Raises:
        InputError: The block has no port of a given name, a value does not have the
            shape of the port or of the state, or a necessary input is missing. The
            message contains the line to type.
    """
    return Bench(block, time_s=time_s, state=state, **inputs).outputs(outputs)


class History(Mapping[str, Any]):
    """Outputs and states of a block at each tick, as ``run`` returns them.

    A history is a mapping: ``history["ranges"]`` has one row per tick and one column
    per element of the port ``ranges``. For a port that carries objects, it is a list.

    Args:
        t: (k,) times of the ticks, s.
        outputs: (k, n) values of each output port by name.
        state: (k, m) states, continuous state first. For a block whose state is a named
            tuple, it is a list of k tuples.
    """

    def __init__(self, t: NDArray[Any], outputs: Mapping[str, Any], state: Any) -> None:
        self.t = t
        self.state = state
        self._outputs = dict(outputs)

    def __getitem__(self, name: str) -> Any:
        return self._outputs[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._outputs)

    def __len__(self) -> int:
        return len(self._outputs)

    def __repr__(self) -> str:
        ports = ", ".join(self) or "none"
        return f"<History of {len(self.t)} ticks, {self.t[-1]:g} s; outputs: {ports}>"


def run(
    block: Any,
    duration_s: float,
    /,
    *,
    state: Any = None,
    tick_s: float | None = None,
    outputs: Iterable[str] | None = None,
    **inputs: Any,
) -> History:
    """Simulates a block alone with Drake's Simulator.

    In row k of the result are the outputs and the state at the time ``k * tick_s``,
    before the update of this tick, and with the inputs of this tick. All inputs are
    constant during a tick.

    Args:
        block: Any Drake system, which must not be part of a diagram.
        duration_s: Duration, s. The result has the rows of the ticks from 0 to the
            duration.
        state: Initial state, see ``evaluate``. None: the block's own initial state.
        tick_s: Duration of a tick, s. None: the period of the block. A block that
            updates nothing periodically has the default control period, 0.025 s.
        outputs: Names of the output ports to evaluate. None: all of them.
        **inputs: Inputs by name. Each is a constant value, see ``evaluate``, a function
            of the time in s that returns the value, or an array with one row per tick.

    Returns:
        The outputs and states over time.

    Raises:
        InputError: A name or a shape is wrong, an array has the wrong number of rows,
            or a necessary input is missing.
    """
    bench = Bench(block, state=state, tick_s=tick_s)
    count = round(duration_s / bench.tick_s) + 1
    names = [*outputs] if outputs is not None else None
    signals = {
        name: _signal(block, name, value, count) for name, value in inputs.items()
    }
    times, states, rows = [], [], list[dict[str, Any]]()
    for k in range(count):
        if k:
            bench.tick()
        bench.set(**{name: signal(k, bench.time_s) for name, signal in signals.items()})
        times.append(bench.time_s)
        states.append(bench.state)
        rows.append(bench.outputs(names))
    found = {name: [row[name] for row in rows] for name in rows[0]}
    numeric = {p.get_name() for p in ports_of(block, "output") if carries_numbers(p)}
    return History(
        np.array(times),
        {n: np.array(v) if n in numeric else v for n, v in found.items()},
        np.array(states) if isinstance(states[0], np.ndarray) else states,
    )


def _signal(
    block: Any, name: str, value: Any, count: int
) -> Callable[[int, float], Any]:
    """Returns the function of tick and time that gives the value of an input."""
    port = input_port(block, name)
    if callable(value):
        return lambda _, time_s: value(time_s)
    if not carries_numbers(port):
        return lambda *_: value
    shape = np.shape(value)
    per_tick = len(shape) == 2 or (port.size() == 1 and len(shape) == 1 != shape[0])
    if not per_tick:
        return lambda *_: value
    if shape[0] != count:
        raise InputError(
            block_name(block),
            f"{name} has {shape[0]} rows; it needs one row per tick, {count} in all",
        )
    return lambda tick, _: value[tick]
