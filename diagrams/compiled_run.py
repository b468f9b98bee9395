"""A scenario's blocks fused into one compiled loop over ticks.

Drake's diagram stays the model. The loop calls the same functions, the ``Step`` of each
block, in the order that the names of their ports give, with the same integrator and the
same random numbers; what it logs is what the diagram logs.

In a tick, as Drake has it: blocks whose outputs are state have published them; all
others do their steps, each after those whose outputs it reads; the row is logged; then
the blocks with state outputs do theirs, and the plant moves on by a tick.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import FunctionType
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from diagrams.robot import Parts
from diagrams.scenario import Scenario
from systems.framework.input_error import InputError
from systems.framework.step_block import RunFacts, Step, compiled_numbers

__all__ = ["CompiledLoop", "compile_loop", "why_not_compiled"]

#: What compiled loops integrate with, and its order.
_ORDERS = {"runge_kutta2": 2, "runge_kutta3": 3}


def why_not_compiled(scenario: Scenario) -> str:
    """Why a scenario has no compiled loop, with the remedy; empty where it has one."""
    if scenario.robots or scenario.sources:
        return "compiled loops are of one robot and one source; leave out the others"
    if scenario.hearing != "ideal":
        return "sound waves are not compiled; set hearing to ideal"
    if scenario.blocks:
        return "blocks of a user's own are not compiled; leave out blocks"
    if scenario.integrator.scheme not in _ORDERS:
        return f"compiled loops integrate with {' or '.join(_ORDERS)}; set that scheme"
    return ""


@dataclass
class CompiledLoop:
    """A run that goes on tick by tick, in compiled code."""

    log: NDArray[np.float64]
    """(ticks + 1, columns) what the diagram logs, as far as the run has come."""
    done: int
    """Ticks that are logged."""
    _function: Any
    _arguments: tuple[Any, ...]

    def advance(self, ticks: int) -> None:
        """Logs so many ticks more, to the end of the run at most."""
        end = min(self.done + ticks, len(self.log))
        self._function(self.done, end, self.log, *self._arguments)
        self.done = end


def compile_loop(scenario: Scenario, parts: Parts) -> CompiledLoop:
    """The loop of a scenario that has one.

    Args:
        scenario: Of one robot.
        parts: Of its diagram, built with a log.

    Returns:
        The loop, before its first tick.

    Raises:
        InputError: The scenario has none (``why_not_compiled``), or numba cannot
            compile its law.
    """
    if reason := why_not_compiled(scenario):
        raise InputError("engine", reason)
    ticks = int(scenario.duration_s / scenario.tick_s + 1e-9)
    run = RunFacts(
        ticks,
        scenario.tick_s,
        scenario.start.pose,
        _ORDERS[scenario.integrator.scheme],
        scenario.integrator.step_s,
    )
    tables = _world(scenario, np.arange(ticks + 1) * scenario.tick_s)
    signals = _Signals(
        parts.blocks, {name: len(row[0]) for name, row in tables.items()}
    )
    steps = {part: block.step_for(run) for part, block in parts.blocks.items()}
    order = _order(parts.blocks, steps, set(tables))
    blocks = tuple(
        (
            np.array(steps[part].state, dtype=float),
            tuple(signals.view(name) for name in _inputs(parts.blocks[part])),
            tuple(signals.view(name) for name in _outputs(parts.blocks[part])),
            compiled_numbers(steps[part].numbers),
        )
        for part in order
    )
    logged = [signals.places[port] for _, port in parts.logged]
    function = _loop([steps[part] for part in order])
    columns = np.concatenate([np.arange(place.start, place.stop) for place in logged])
    arguments = (
        signals.values,
        columns,
        tuple(signals.view(name) for name in tables),
        tuple(tables.values()),
        blocks,
    )
    log = np.empty((ticks + 1, len(columns)))
    return CompiledLoop(log, 0, function, arguments)


def _world(
    scenario: Scenario, times: NDArray[np.float64]
) -> dict[str, NDArray[np.float64]]:
    """What the robot takes from the world, a row a tick; of what rests, one."""
    around = scenario.surroundings()
    bodies = [*around.obstacles.values()]
    poses = [body.path.poses(times) for body in bodies]
    sizes = [extent for body in bodies for extent in body.size]
    empty = np.empty((len(times), 0))
    return {
        "pose_WS": np.ascontiguousarray(around.followed.path.poses(times)),
        "poses_WO": np.hstack(poses) if poses else empty,
        "sizes": np.tile(np.array(sizes, dtype=float), (len(times), 1)),
    }


class _Signals:
    """What the ports carry, one after the other in one array."""

    def __init__(self, blocks: Mapping[str, Any], outside: Mapping[str, int]) -> None:
        sizes = dict(outside)
        for block in blocks.values():
            for index in range(block.num_output_ports()):
                port = block.get_output_port(index)
                sizes[port.get_name()] = port.size()
        ends = np.cumsum([*sizes.values()]).tolist()
        self.places = {
            name: slice(end - size, end)
            for (name, size), end in zip(sizes.items(), ends, strict=True)
        }
        self.values = np.zeros(ends[-1])

    def view(self, name: str) -> NDArray[np.float64]:
        """What a port carries."""
        return self.values[self.places[name]]


def _inputs(block: Any) -> list[str]:
    ports = map(block.get_input_port, range(block.num_input_ports()))
    return [port.get_name() for port in ports]


def _outputs(block: Any) -> list[str]:
    ports = map(block.get_output_port, range(block.num_output_ports()))
    return [port.get_name() for port in ports]


def _order(
    blocks: Mapping[str, Any], steps: Mapping[str, Step], known: set[str]
) -> list[str]:
    """Parts as they do their steps: state outputs last, and the plant after them."""
    late = [part for part, step in steps.items() if step.publish is not None]
    late.sort(key=lambda part: part == "plant")
    known = known.union(*(_outputs(blocks[part]) for part in late))
    waiting, order = [part for part in blocks if part not in late], []
    while waiting:
        part = next(p for p in waiting if known.issuperset(_inputs(blocks[p])))
        waiting.remove(part)
        order.append(part)
        known.update(_outputs(blocks[part]))
    return [*order, *late]


def _loop(steps: Sequence[Step]) -> Any:
    """The function over ticks; compiled when it is first called."""
    early = [k for k, step in enumerate(steps) if step.publish is None]
    late = [k for k, step in enumerate(steps) if step.publish is not None]
    publish = [f"    publish_{k}(blocks[{k}][0], *blocks[{k}][2:])" for k in late]
    lines = [
        "def loop(begin, end, log, signals, columns, outside, tables, blocks):",
        "    if begin == 0:",
        *(f"    {line}" for line in publish),
        "    for tick in range(begin, end):",
        *(f"        fill(outside[{k}], tables[{k}], tick)" for k in range(3)),
        *(
            line
            for k in early
            for line in (
                f"        clear(blocks[{k}][2])",
                f"        step_{k}(tick, *blocks[{k}])",
            )
        ),
        "        write(log, tick, signals, columns)",
        *(f"        step_{k}(tick, *blocks[{k}])" for k in late[:-1]),
        *(f"    {line}" for line in publish[:-1]),
        f"        step_{late[-1]}(tick, *blocks[{late[-1]}])",
        f"    {publish[-1]}",
    ]
    names: dict[str, Any] = {"fill": _fill, "clear": _clear, "write": _write}
    for k, step in enumerate(steps):
        names[f"step_{k}"] = _compilable(step.step)
        names[f"publish_{k}"] = step.publish and _compilable(step.publish)
    exec("\n".join(lines), names)
    return njit(names["loop"])


def _compilable(function: Any) -> Any:
    return njit(function) if isinstance(function, FunctionType) else function


@njit(cache=True)
def _fill(out: Any, table: Any, tick: int) -> None:  # pragma: no cover  (compiled)
    for k in range(len(out)):
        out[k] = table[tick, k]


@njit(cache=True)
def _clear(outputs: Any) -> None:  # pragma: no cover  (compiled)
    for k in range(len(outputs)):
        for j in range(len(outputs[k])):
            outputs[k][j] = 0.0


@njit(cache=True)
def _write(
    log: Any, tick: int, signals: Any, columns: Any
) -> None:  # pragma: no cover  (compiled)
    for k in range(len(columns)):
        log[tick, k] = signals[columns[k]]
