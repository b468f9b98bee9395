"""Lists the parts that a compiled loop calls in each tick, and their order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from diagrams.running.compiled.loop_blocks import LoopDiagram
from diagrams.running.compiled.parts import PUBLISH, clear, copy, fill
from diagrams.running.compiled.source import LoopPart, address_of, compiled_part
from diagrams.running.referee import Referee
from diagrams.running.stop_rules import READ_PORTS, run_is_over
from diagrams.scenario.bodies import Surroundings
from diagrams.scenario.participants import SourceParameters
from systems.framework.block import Step, has_arrays
from systems.framework.host_step import HostCall, HostFunction, host_step


class LoopPlan:
    """Collects the parts of a compiled loop, in the order of their calls in a tick.

    A part is a compiled function, for example the step of one block. A tick is a
    control period.

    Args:
        robots: Diagram of each robot, by name of the robot.
        times: (n,) times of the ticks, s.
    """

    def __init__(
        self, robots: Mapping[str, LoopDiagram], times: NDArray[np.float64]
    ) -> None:
        self._robots, self._times = robots, times
        self.logged: list[NDArray[np.float64]] = []
        """Values that a row of the log contains."""
        self.hosts: list[HostCall] = []
        """Functions that the loop calls in Python."""
        self._parts: list[tuple[LoopPart, str]] = []
        self._judge = 0
        self._filled: list[int] = []
        self._early: list[int] = []
        self._late: list[int] = []
        self._plants: list[int] = []

    def add(self, diagram: LoopDiagram) -> None:
        """Adds the blocks of a robot, or the blocks that all robots share, to the plan.

        Blocks of loudspeakers come first in a tick (control period), because several
        robots hear their sound. ``diagram`` has the blocks with their steps and port
        values.
        """
        made, values = diagram.made, diagram.values
        early, late = made.order(diagram.steps)
        for part in (*early, *late):
            step = diagram.steps[part]
            inputs = tuple(
                diagram.carried[key](0)
                if key in made.objects and step.host is None
                else values[key]
                for key in made.inputs[part].values()
            )
            outputs = tuple(
                values[key] for key in made.outputs[part] if key not in made.objects
            )
            number = self._step(step, inputs, outputs)
            if part == "emitter":
                self._filled.append(number)
            elif step.publish is None:
                self._early.append(number)
            else:
                (self._plants if part == "plant" else self._late).append(number)
        self.logged += [values[key] for key in made.columns]

    def add_source(self, source: SourceParameters, emitter: Step) -> None:
        """Adds a source with a loudspeaker to the plan.

        Args:
            source: Path of the source. The method tabulates the poses and velocities at
                all ticks (control periods).
            emitter: Step of the loudspeaker's block.
        """
        path, times = source.path(), self._times
        velocities = np.array([path.velocity(time) for time in times.tolist()])
        pose_WS, v_WS = np.zeros((2, 3))
        for into, table in ((pose_WS, path.poses(times)), (v_WS, velocities)):
            self._fill_by(fill, into, np.zeros(1, dtype=np.int64), table[None])
        self._filled.append(self._step(emitter, (pose_WS, v_WS), ()))

    def call(self, function: HostFunction) -> None:
        """Adds a Python function that the loop calls at every tick (control period).

        The loop calls the function before the stop rules judge the robots. The
        arguments of the function are the tick and two arrays. The function ignores the
        arrays.
        """
        nothing = (np.zeros(1),)  # compiled code has no empty state
        self._early.append(self._step(host_step(function, 1, 0, 1), nothing, ()))

    def _step(
        self, step: Step, inputs: tuple[Any, ...], outputs: tuple[Any, ...]
    ) -> int:
        """Adds the step of a block as a part with generated source code.

        If the outputs of the block depend only on its state, the loop calls the part
        twice per tick. With the number of the tick, the part computes the step. With
        ``PUBLISH`` as the tick, it publishes the outputs. For any other block, the loop
        calls the part once per tick. The part sets the outputs to zero, and then the
        step fills them.

        Returns:
            Number of the part.
        """
        if step.host is not None:
            self.hosts.append(step.host)
        part, state = LoopPart(), step.state
        if not has_arrays(state):
            state = np.array(state, dtype=float)
        values = {"state": state, "inputs": inputs, "outputs": outputs}
        values["numbers"] = step.numbers
        lines = [f"{name} = {part.expression(it)}" for name, it in values.items()]
        if step.publish is not None:
            publish = f"{part.name(step.publish)}(state, outputs, numbers)"
            lines += [f"if tick == {PUBLISH}:", f"    {publish}", "    return 0"]
        elif outputs:
            lines.append(f"{part.name(clear)}(outputs)")
        lines.append(f"{part.name(step.step)}(tick, state, inputs, outputs, numbers)")
        return self._add(part, lines)

    def surround(self, name: str, around: Surroundings) -> None:
        """Adds parts that fill a robot's inputs with poses and sizes of other bodies.

        The method sets the sizes once, because they never change. It tabulates the
        poses of bodies on known paths for all ticks (control periods). At every tick,
        the loop copies the poses of other robots from their ports.

        Args:
            name: Name of the robot.
            around: The bodies that the robot can see and hit.
        """
        values, robots, times = self._robots[name].values, self._robots, self._times
        wanted = {
            "pose_WS": {around.target: around.followed},
            "poses_WO": around.obstacles,
        }
        for port, bodies in wanted.items():
            if ("", port) in values:
                into = values["", port]
                # Poses of bodies at rest, and of bodies that move.
                places: tuple[list[int], list[int]] = ([], [])
                tables: tuple[list[Any], list[Any]] = ([], [])
                begin = 0
                for other, body in bodies.items():
                    # A body has one pose in the port per rectangle.
                    end = begin + 3 * len(body.shape.rectangles)
                    if other in robots:
                        pose = robots[other].values["plant", "pose_WB"]
                        self._fill_by(copy, into, begin, pose)
                    else:
                        moves = body.path.moves
                        at = times if moves else times[:1]
                        places[moves].extend(range(begin, end, 3))
                        tables[moves].append(body.rectangles_over(at)[..., :3])
                    begin = end
                for numbers, known in zip(places, tables, strict=True):
                    if known:
                        poses = np.concatenate(known)
                        rows = np.array(numbers, dtype=np.int64)
                        self._fill_by(fill, into, rows, poses)
        if ("", "sizes") in values:
            sizes = [body.shape.rectangles[:, 3:] for body in around.obstacles.values()]
            values["", "sizes"][:] = np.concatenate([np.empty((0, 3)), *sizes]).ravel()

    def _fill_by(self, function: Any, *values: Any) -> None:
        """Adds a part that fills a port by a function of values and the tick."""
        part = LoopPart()
        arguments = ", ".join(map(part.expression, values))
        line = f"{part.name(function)}({arguments}, tick)"
        self._filled.append(self._add(part, [line]))

    def judge(self, referee: Referee) -> None:
        """Adds the steps of the referee to the plan, and the part that ends the run.

        A part is a compiled function that the loop calls. The referee applies the stop
        rules to all robots.
        """
        for name, step in referee.steps.items():
            robot = self._robots[name]
            inputs: list[Any] = [referee.poses]
            for port, size in READ_PORTS.items():
                values = robot.output(port)
                inputs.append(np.zeros(size) if values is None else values)
            self._early.append(self._step(step, tuple(inputs), ()))
        part = LoopPart()
        over = f"{part.name(run_is_over)}({part.expression(referee.found)})"
        self._judge = self._add(part, [f"if {over}:", "    return 1"])

    def _add(self, part: LoopPart, lines: Sequence[str]) -> int:
        self._parts.append((part, part.source(lines)))
        return len(self._parts) - 1

    @cached_property
    def arguments(self) -> tuple[Any, ...]:
        """Arguments of ``run_parts`` after ``log``; the first use compiles parts."""
        self._kept = [
            (compiled_part(text, part.names), part.words())
            for part, text in self._parts
        ]
        parts = [(address_of(code), words.ctypes.data) for code, words in self._kept]
        ports = [(values.ctypes.data, values.size) for values in self.logged]
        late, plants = (
            [(part, publishes) for publishes in (False, True) for part in of_a_kind]
            for of_a_kind in (self._late, self._plants)
        )
        begins, first = [*self._late, *self._plants], [*self._filled, *self._early]
        return (
            _table(ports),
            _table(parts),
            (
                np.array(begins, dtype=np.int64),
                np.array(first, dtype=np.int64),
                self._judge,
                _table(late),
                _table(plants),
            ),
        )


def _table(pairs: Sequence[tuple[int, int]]) -> NDArray[np.int64]:
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)
