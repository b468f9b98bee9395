"""A scenario's blocks fused into one compiled loop over ticks.

Drake's diagram stays the model. The loop calls the same functions, the ``Step`` of each
block, in the order that the names of their ports give, with the same integrator and the
same random numbers; what it logs is what the diagram logs.

In a tick, as Drake has it: blocks whose outputs are state have published them; all
others do their steps, each after those whose outputs it reads; the row is logged; then
the blocks with state outputs do theirs, and the plant moves on by a tick.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numba.core.errors import NumbaError
from numpy.typing import NDArray

from diagrams.robot import Parts
from diagrams.run_parameters import COMPILED_ORDERS
from diagrams.scenario import Scenario
from diagrams.stop_rules import (
    BETWEEN_TICKS,
    UNJUDGED,
    JudgedTick,
    RobotRules,
    judge_tick,
)
from systems.framework.input_error import InputError, shortened
from systems.framework.step_block import (
    RunFacts,
    Step,
    as_compiled,
    compiled_numbers,
)
from systems.world.geometry import rectangle_clearance

__all__ = ["CompiledLoop", "compile_loop"]


@dataclass
class CompiledLoop:
    """A run that goes on tick by tick, in compiled code."""

    log: NDArray[np.float64]
    """(ticks + 1, columns) what the diagram logs, as far as the run has come."""
    tick_s: float
    rules: RobotRules
    """Know why it ended, once it has."""
    over: bool = False
    """Whether the run has ended."""
    done: int = 0
    """Ticks that are logged."""
    _judged: NDArray[np.float64] = field(default_factory=lambda: np.array(UNJUDGED))
    _columns: Sequence[str] = ()
    _function: Any = None
    _arguments: tuple[Any, ...] = ()

    @property
    def time_s(self) -> float:
        """Of the last tick that is logged, s."""
        return (self.done - 1) * self.tick_s

    def prepare(self) -> None:
        """Compiles the loop, where the process has not done so for its kind.

        Raises:
            InputError: numba cannot compile the law of a user's own.
        """
        try:
            self._function(1, 1, self.log, self._judged, *self._arguments)
        # What numba raises depends on what it does not know.
        except (NumbaError, NotImplementedError, ValueError) as error:
            law = self.rules.scenario.law
            if ":" not in law:
                raise
            raise InputError(
                "engine",
                f"numba cannot compile law {law!r} ({_complaint(error)}); run with "
                "engine drake",
            ) from None

    def advance(self, ticks: int) -> None:
        """Goes on for so many ticks, to the end of the run at most.

        Raises:
            InputError: A value became NaN or infinite.
        """
        end = min(self.done + ticks, len(self.log))
        self.done, found, touched = self._function(
            self.done, end, self.log, self._judged, *self._arguments
        )
        if not np.isfinite(self.log[self.done - 1]).all():
            raise InputError(
                "engine",
                f"a value is not finite at {self.time_s:g} s; run with engine drake, "
                "which names the block",
            )
        self.over = found > 0 or touched or self.done == len(self.log)
        if self.over:
            self.rules.take_over(self._last_tick(found, touched=touched))

    def _last_tick(self, found: int, *, touched: bool) -> JudgedTick:
        last = self.done - 1
        names = [*self._columns]
        pose = [names.index(name) for name in ("p_WB_x", "p_WB_y", "theta_WB")]
        return JudgedTick(
            last * self.tick_s,
            max(last - 1, 0) * self.tick_s,
            self.log[last, pose].tolist(),
            self.log[last - 1, pose].tolist() if last else None,
            bool(self.log[last, names.index("target_valid")] > 0.5),
            self._judged.tolist(),
            found,
            touched,
        )


def _complaint(error: Exception) -> str:
    """What numba complains of, without the way there."""
    lines = (line.strip() for line in str(error).splitlines())
    around = "During", "raised", "Failed in"
    known = (line for line in lines if line and not line.startswith(around))
    return shortened(next(known, type(error).__name__), 120)


def compile_loop(scenario: Scenario, parts: Parts, rules: RobotRules) -> CompiledLoop:
    """The loop of a scenario that has one.

    Args:
        scenario: Of one robot.
        parts: Of its diagram, built with a log.
        rules: When the run ends.

    Returns:
        The loop, before its first tick.

    Raises:
        InputError: The scenario has none (``Scenario.require_compilable``), or a
            block of a user's own has no step.
    """
    scenario.require_compilable()
    ticks = int(scenario.duration_s / scenario.tick_s + 1e-9)
    run = RunFacts(
        ticks,
        scenario.tick_s,
        scenario.start.pose,
        COMPILED_ORDERS[scenario.integrator.scheme],
        scenario.integrator.step_s,
    )
    times: NDArray[np.float64] = np.arange(ticks + 1.0) * scenario.tick_s
    tables = _world(scenario, times)
    widths = {name: table.shape[1] for name, table in tables.items()}
    signals = _Signals(parts.blocks, widths)
    steps = {part: _step_for(block, run) for part, block in parts.blocks.items()}
    order = _order(parts.blocks, steps, set(tables))
    logged = [signals.places[port] for _, port in parts.logged]
    columns = np.concatenate([np.arange(place.start, place.stop) for place in logged])
    watched = "pose_WB", "velocity_WB", "pose_WS", "target_valid"
    arguments = (
        signals.values,
        columns,
        tuple(map(signals.view, tables)),
        tuple(tables.values()),
        tuple(
            (
                np.array(steps[part].state, dtype=float),
                tuple(map(signals.view, _inputs(parts.blocks[part]))),
                tuple(map(signals.view, _outputs(parts.blocks[part]))),
                compiled_numbers(steps[part].numbers),
            )
            for part in order
        ),
        (*map(signals.view, watched), np.array(scenario.start.pose)),
        _contacts(scenario, rules, times),
    )
    return CompiledLoop(
        np.empty((ticks + 1, len(columns))),
        scenario.tick_s,
        rules,
        _columns=[name for names in parts.logged.values() for name in names],
        _function=_loop(tuple(steps[part][::3] for part in order)),
        _arguments=arguments,
    )


def _step_for(block: Any, run: RunFacts) -> Step:
    if not hasattr(block, "step_for"):
        raise InputError(
            "engine",
            f"{block.get_name()} has no method step_for, by which it would join a "
            "compiled loop; give it one, or run with engine drake",
        )
    step: Step = block.step_for(run)
    return step


class _Contacts(NamedTuple):
    """What a tick is judged by."""

    rules: Any
    tick_s: float
    size: tuple[float, float]
    """Length and width of the robot, m."""
    sizes: NDArray[np.float64]
    """(n, 2) of the bodies, m."""
    reach: NDArray[np.float64]
    """(n,) m: farther away, a body does not touch the robot."""
    poses: NDArray[np.float64]
    """(n, 5 ticks + 1, 3) of the bodies, at ticks and in between."""


def _contacts(
    scenario: Scenario, rules: RobotRules, times: NDArray[np.float64]
) -> _Contacts:
    parts = np.arange(1, BETWEEN_TICKS + 1) / BETWEEN_TICKS
    between = times[:-1, None] + parts * (times[1:] - times[:-1])[:, None]
    instants = np.concatenate([times[:1], between.ravel()])
    poses = np.empty((len(rules.reach), len(instants), 3))
    for row, (_, body, _) in zip(poses, rules.reach, strict=True):
        row[:] = body.path.poses(instants if body.path.moves else instants[:1])
    return _Contacts(
        compiled_numbers(rules.numbers),
        scenario.tick_s,
        scenario.size,
        np.array([body.size for _, body, _ in rules.reach]),
        np.array([reach for _, _, reach in rules.reach]),
        poses,
    )


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


@cache
def _loop(steps: tuple[tuple[Any, Any], ...]) -> Any:
    """The function over ticks, compiled when it is first called.

    Args:
        steps: Step and publish of each block, in the order of ``_order``.
    """
    early = [k for k, (_, publish) in enumerate(steps) if publish is None]
    late = [k for k, (_, publish) in enumerate(steps) if publish is not None]
    publish = [f"publish_{k}(blocks[{k}][0], *blocks[{k}][2:])" for k in late]
    step = [f"step_{k}(tick, *blocks[{k}])" for k in range(len(steps))]
    cleared = [f"clear(blocks[{k}][2]); {step[k]}" for k in early]
    lines = [
        "def loop(",
        "    begin, end, log, judged,",
        "    signals, columns, outside, tables, blocks, watched, contacts",
        "):",
        "    if begin == 0:",
        *(f"        {line}" for line in publish),
        "    for tick in range(begin, end):",
        *(f"        fill(outside[{k}], tables[{k}], tick)" for k in range(3)),
        *(f"        {line}" for line in cleared),
        "        write(log, tick, signals, columns)",
        "        found, touched = judge(tick, judged, watched, contacts)",
        "        if found > 0 or touched:",
        "            return tick + 1, found, touched",
        *(f"        {step[k]}" for k in late[:-1]),
        *(f"        {line}" for line in publish[:-1]),
        f"        {step[late[-1]]}",
        f"        {publish[-1]}",
        "    return end, 0, False",
    ]
    names: dict[str, Any] = {
        "fill": _fill,
        "clear": _clear,
        "write": _write,
        "judge": _judge,
    }
    for k, (function, publishing) in enumerate(steps):
        names[f"step_{k}"] = as_compiled(function)
        names[f"publish_{k}"] = publishing and as_compiled(publishing)
    exec("\n".join(lines), names)
    return njit(names["loop"])


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


_judge_tick = njit(judge_tick)


@njit
def _judge(
    tick: int, judged: Any, watched: Any, contacts: _Contacts
) -> tuple[int, bool]:  # pragma: no cover  (compiled)
    """Cause of the end by ``judge_tick``, and whether a body is touched."""
    pose, velocity, pose_WS, valid, before = watched
    for body in range(len(contacts.reach)):
        if _touched(tick, pose, before, body, contacts):
            return 0, True
    found = _judge_tick(
        tick * contacts.tick_s,
        judged,
        pose,
        velocity,
        pose_WS,
        valid[0] > 0.5,
        contacts.rules,
    )
    for k in range(3):
        before[k] = pose[k]
    return found, False


@njit
def _touched(
    tick: int, pose: Any, before: Any, body: int, contacts: _Contacts
) -> bool:  # pragma: no cover  (compiled)
    """Whether robot and body touch since the last tick, as ``RobotRules`` looks."""
    poses, (length, width) = contacts.poses[body], contacts.size
    at = BETWEEN_TICKS * tick
    dx, dy = poses[at, 0] - pose[0], poses[at, 1] - pose[1]
    if math.hypot(dx, dy) > contacts.reach[body]:
        return False
    mine, other = np.empty(5), np.empty(5)
    mine[3], mine[4] = length, width
    other[3], other[4] = contacts.sizes[body, 0], contacts.sizes[body, 1]
    for number in range(1, BETWEEN_TICKS + 1):
        row, part = at - BETWEEN_TICKS + number, number / BETWEEN_TICKS
        if tick == 0:
            row, part = 0, 0.0
        for k in range(3):
            mine[k] = before[k] + part * (pose[k] - before[k])
            other[k] = poses[row, k]
        if rectangle_clearance(mine, other) < 0.0:
            return True
    return False
