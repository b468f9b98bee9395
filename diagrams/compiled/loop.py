"""A scenario's blocks fused into one compiled loop over ticks.

Drake's diagram stays the model. The loop calls the same functions, the ``Step`` of each
block, in the order that the names of their ports give, with the same integrator and the
same random numbers; what it logs is what the diagram logs.

In a tick, as Drake has it: blocks whose outputs are state have published them; all
others do their steps, each after those whose outputs it reads; the row is logged; then
the blocks with state outputs do theirs, and the plants move on by a tick.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numba import njit
from numba.core.errors import NumbaError
from numpy.typing import NDArray

from diagrams.bodies import Surroundings
from diagrams.compiled.judge import contacts_of, judge_all
from diagrams.compiled.loop_blocks import LoopBlocks
from diagrams.compiled.sounds import sounds_of_a_run
from diagrams.compiled.source import PACKED, Packing, compiled_from
from diagrams.robot import seed_of
from diagrams.scenario import Scenario
from diagrams.stop_rules import GIVES_UP, UNJUDGED, JudgedTick, RunRules
from systems.framework.host_step import HostCall, HostError, HostFunction, host_step
from systems.framework.input_error import InputError, shortened
from systems.framework.step_block import RunFacts

__all__ = ["CompiledLoop", "compile_loop"]


@dataclass
class CompiledLoop:
    """A run that goes on tick by tick, in compiled code."""

    log: NDArray[np.float64]
    """(ticks + 1, columns) what all robots log, as far as the run has come."""
    tick_s: float
    rules: RunRules
    """Know why it ended, once it has."""
    columns: Mapping[str, Mapping[str, int]]
    """Of each robot its columns of the log, by name."""
    over: bool = False
    """Whether the run has ended."""
    done: int = 0
    """Ticks that are logged."""
    _judged: NDArray[np.float64] = field(init=False)
    _ended: NDArray[np.int64] = field(init=False)
    _function: Any = None
    _arguments: tuple[Any, ...] = ()
    _hosts: Sequence[Any] = ()
    """Steps in Python."""

    def __post_init__(self) -> None:
        robots = len(self.rules.robots)
        self._judged = np.tile(np.array(UNJUDGED), (robots, 1))
        self._ended = np.zeros((robots, 2), dtype=np.int64)

    @property
    def time_s(self) -> float:
        """Of the last tick that is logged, s."""
        return (self.done - 1) * self.tick_s

    def logged(self, robot: str) -> dict[str, NDArray[np.float64]]:
        """A robot's columns, and the time.

        Args:
            robot: Its name.

        Returns:
            (ticks,) each, by name.
        """
        log = np.ascontiguousarray(self.log[: self.done].T)
        times: NDArray[np.float64] = np.arange(float(self.done)) * self.tick_s
        return {"t": times, **{n: log[k] for n, k in self.columns[robot].items()}}

    def prepare(self) -> None:
        """Compiles the loop or loads it, where the process has not done so.

        Raises:
            InputError: numba cannot compile a law or a block of a user's own.
        """
        try:
            self._call(1, 1)
        # What numba raises depends on what it does not know.
        except (NumbaError, NotImplementedError, ValueError) as error:
            own = [
                text
                for rules in self.rules.robots.values()
                for text in (rules.scenario.law, *rules.scenario.blocks)
                if ":" in text
            ]
            if not own:
                raise
            raise InputError(
                "engine",
                f"numba cannot compile {' or '.join(map(repr, own))} "
                f"({_complaint(error)}); run with engine drake",
            ) from None

    def _call(self, begin: int, end: int) -> tuple[int, bool]:
        state = self.log, self._judged, self._ended
        try:
            done: tuple[int, bool] = self._function(
                begin, end, *state, *self._arguments
            )
        except HostError:
            raise next(host.error for host in self._hosts if host.error) from None
        return done

    def advance(self, ticks: int) -> None:
        """Goes on for so many ticks, to the end of the run at most.

        Raises:
            InputError: A value became NaN or infinite.
        """
        end = min(self.done + ticks, len(self.log))
        self.done, over = self._call(self.done, end)
        if not np.isfinite(self.log[self.done - 1]).all():
            raise InputError(
                "engine",
                f"a value is not finite at {self.time_s:g} s; run with engine drake, "
                "which names the block",
            )
        self.over = over or self.done == len(self.log)
        if self.over:
            names = enumerate(self.rules.robots)
            self.rules.take_over({name: self._last_tick(k, name) for k, name in names})

    def _last_tick(self, number: int, robot: str) -> JudgedTick:
        last, columns = self.done - 1, self.columns[robot]
        pose = [columns[name] for name in ("p_WB_x", "p_WB_y", "theta_WB")]
        before = max(last - 1, 0)
        found, touched = self._ended[number].tolist()
        return JudgedTick(
            last * self.tick_s,
            before * self.tick_s,
            self.log[last, pose].tolist(),
            self.log[before, pose].tolist(),
            bool(self.log[last, columns["target_valid"]] > 0.5),
            self._judged[number].tolist(),
            found,
            bool(touched),
        )


def _complaint(error: Exception) -> str:
    """What numba complains of, without the way there."""
    lines = (line.strip() for line in str(error).splitlines())
    around = "During", "raised", "Failed in"
    known = (line for line in lines if line and not line.startswith(around))
    return shortened(next(known, type(error).__name__), 120)


def compile_loop(
    scenario: Scenario, blocks: Mapping[str, LoopBlocks], rules: RunRules
) -> CompiledLoop:
    """The loop of a scenario that has one.

    Args:
        scenario: What to run.
        blocks: Of each robot; they may be made for another start or seed.
        rules: When the run ends.

    Returns:
        The loop, before its first tick.

    Raises:
        InputError: A block of a user's own has no step, or a sound file cannot be
            played.
    """
    ticks = int(scenario.duration_s / scenario.tick_s + 1e-9)
    times: NDArray[np.float64] = np.arange(ticks + 1.0) * scenario.tick_s
    sounds = sounds_of_a_run(scenario, times)
    robots = {
        name: _LoopRobot(scenario, name, own, ticks, sounds.heard[name])
        for name, own in blocks.items()
    }
    packing = Packing()
    source = _Source(packing)
    for name, robot in robots.items():
        source.surround(rules.robots[name].surroundings, robot, robots, times)
    hosts = [
        source.remember(robots[name], function)
        for name, function in sounds.carried.items()
    ]
    for robot in robots.values():
        hosts += source.add(robot)
    text = source.text(
        scenario.tick_s,
        tuple(
            (*map(robot.view, _WATCHED), np.array(robot.facts.initial_pose))
            for robot in robots.values()
        ),
        tuple(contacts_of(rules.robots[name], [*robots], times) for name in robots),
        tuple(
            robot.view(port)
            for robot in robots.values()
            for _, port in robot.made.columns
        ),
    )
    width, columns = 0, {}
    for name, own in blocks.items():
        wanted = [text for texts in own.columns.values() for text in texts]
        columns[name] = {text: width + k for k, text in enumerate(wanted)}
        width += len(wanted)
    return CompiledLoop(
        np.empty((ticks + 1, width)),
        scenario.tick_s,
        rules,
        columns,
        _function=compiled_from(text, packing.names),
        _arguments=packing.values,
        _hosts=hosts,
    )


#: What a robot is judged by, and its pose at the tick before.
_WATCHED = "pose_WB", "velocity_WB", "pose_WS", "target_valid", GIVES_UP


#: What a step is called with after the tick.
_STEP_PARTS = "state", "inputs", "outputs", "numbers"


class _LoopRobot:
    """One robot of a run: its blocks' steps, and what their ports carry."""

    def __init__(
        self,
        scenario: Scenario,
        name: str,
        made: LoopBlocks,
        ticks: int,
        heard: Mapping[str, Callable[[int], Any]],
    ) -> None:
        own = scenario.all_robots[name]
        self.facts = RunFacts(
            ticks,
            scenario.tick_s,
            own.start.pose,
            scenario.integrator.scheme,
            scenario.integrator.step_s,
            partial(seed_of, scenario, owner=name),
            {**heard},
        )
        self.made, self.steps = made, made.steps(self.facts)
        sizes = {GIVES_UP: 1, **made.sizes}
        self._views = {port: np.zeros(size) for port, size in sizes.items()}

    def view(self, port: str) -> NDArray[np.float64]:
        """What a port carries."""
        return self._views[port]


class _Source:
    """The lines of a loop."""

    def __init__(self, packing: Packing) -> None:
        self._packing = packing
        self._blocks = 0
        self._made: list[str] = []
        self._filled: list[str] = []
        self._early: list[str] = []
        self._late: list[str] = []
        self._plants: list[str] = []
        self._published: dict[bool, list[str]] = {False: [], True: []}

    def add(self, robot: _LoopRobot) -> list[HostCall]:
        """A robot's blocks; returns what they call in Python."""
        made, (early, late) = robot.made, robot.made.order(robot.steps)
        for part in (*early, *late):
            step = robot.steps[part]
            parts = (
                np.array(step.state, dtype=float),
                tuple(map(robot.view, made.inputs[part])),
                tuple(map(robot.view, made.outputs[part])),
                step.numbers,
            )
            own = [
                self._let(f"{n}_{self._blocks}", x)
                for n, x in zip(_STEP_PARTS, parts, strict=True)
            ]
            self._blocks += 1
            call = self._call(step.step, "tick", *own)
            if step.publish is None:
                self._early += [self._call(_clear, own[2]), call]
                continue
            plant = part == "plant"
            (self._plants if plant else self._late).append(call)
            state, _, outputs, numbers = own
            publish = self._call(step.publish, state, outputs, numbers)
            self._published[plant].append(publish)
        return [step.host for step in robot.steps.values() if step.host is not None]

    def remember(self, robot: _LoopRobot, function: HostFunction) -> HostCall:
        """Shows a robot's motion to a Python function at the begin of every tick."""
        motion = tuple(map(robot.view, ("pose_WB", "velocity_WB")))
        step = host_step(function, sum(map(len, motion)), 0, 1)
        names = [f"{each}_of_sound_{len(self._filled)}" for each in _STEP_PARTS]
        parts = np.array(step.state), motion, (), step.numbers
        own = [self._let(n, part) for n, part in zip(names, parts, strict=True)]
        self._filled.append(self._call(step.step, "tick", *own))
        return step.host

    def surround(
        self,
        around: Surroundings,
        robot: _LoopRobot,
        robots: Mapping[str, _LoopRobot],
        times: NDArray[np.float64],
    ) -> None:
        """What a robot takes from the world in every tick."""
        wanted = {"pose_WS": [around.target], "poses_WO": [*around.obstacles]}
        for port, bodies in wanted.items():
            if port in robot.made.outside:
                into = self._packing.expression(robot.view(port))
                known = {3 * k: b for k, b in enumerate(bodies) if b not in robots}
                paths = [around.bodies[body].path for body in known.values()]
                at = times if any(path.moves for path in paths) else times[:1]
                places = np.array([*known], dtype=np.int64)
                poses = np.reshape([path.poses(at) for path in paths], (-1, len(at), 3))
                self._fill_by(_fill, into, places, poses, "tick")
                for k, body in enumerate(bodies):
                    if body in robots:
                        self._fill_by(_copy, into, 3 * k, robots[body].view("pose_WB"))
        if "sizes" in robot.made.outside:
            sizes = [body.size for body in around.obstacles.values()]
            robot.view("sizes")[:] = np.ravel(sizes)

    def _fill_by(self, function: Any, into: str, *values: Any) -> None:
        """A line that fills a port from values; text stands for itself."""
        expressions = (
            value if isinstance(value, str) else self._packing.expression(value)
            for value in values
        )
        self._filled.append(self._call(function, into, *expressions))

    def text(self, tick_s: float, watched: Any, contacts: Any, logged: Any) -> str:
        """The source, with what robots are judged by and what is logged."""
        self._let("tick_s", tick_s)
        self._let("watched", watched)
        self._let("contacts", contacts)
        self._let("logged", logged)
        judged = "tick, tick_s, watched, contacts, judged, ended"
        published = self._published[False], self._published[True]
        body = [
            *self._made,
            "if begin == 0:",
            *_indented([*published[0], *published[1]]),
            "for tick in range(begin, end):",
            *_indented(
                [
                    *self._filled,
                    *self._early,
                    self._call(_write, "log", "tick", "logged"),
                    f"if {self._call(judge_all, judged)}:",
                    "    return tick + 1, True",
                    *self._late,
                    *published[0],
                    *self._plants,
                    *published[1],
                ]
            ),
            "return end, False",
        ]
        head = f"def loop(begin, end, log, judged, ended, {PACKED}):"
        return "\n".join([head, *_indented(body), ""])

    def _let(self, name: str, value: Any) -> str:
        """A local name of a value."""
        self._made.append(f"{name} = {self._packing.expression(value)}")
        return name

    def _call(self, function: Any, *arguments: str) -> str:
        return f"{self._packing.name(function)}({', '.join(arguments)})"


def _indented(lines: Sequence[str]) -> list[str]:
    return [f"    {line}" for line in lines]


@njit(cache=True)
def _fill(
    out: Any, places: Any, poses: Any, tick: int
) -> None:  # pragma: no cover  (compiled)
    """From the row of a tick; where all rest there is but one."""
    row = min(tick, poses.shape[1] - 1)
    for body in range(len(places)):
        for k in range(3):
            out[places[body] + k] = poses[body, row, k]


@njit(cache=True)
def _copy(out: Any, first: int, values: Any) -> None:  # pragma: no cover  (compiled)
    for k in range(len(values)):
        out[first + k] = values[k]


@njit(cache=True)
def _clear(outputs: Any) -> None:  # pragma: no cover  (compiled)
    for k in range(len(outputs)):
        for j in range(len(outputs[k])):
            outputs[k][j] = 0.0


@njit(cache=True)
def _write(log: Any, tick: int, logged: Any) -> None:  # pragma: no cover  (compiled)
    column = 0
    for k in range(len(logged)):
        for j in range(len(logged[k])):
            log[tick, column] = logged[k][j]
            column += 1
