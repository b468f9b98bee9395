"""Runs the blocks of a scenario in one compiled loop over ticks (control periods).

Drake's diagram remains the model: the loop calls the same step functions of the blocks
as Drake does, in an order that follows from the connections in the diagram. The
integrator, the random numbers and the logged columns are also the same.

Some outputs depend only on the state of their block (state outputs). As in Drake, each
tick has this order:

1. The state outputs are already published.
2. The blocks with other outputs compute their steps. Each block comes after the blocks
   whose outputs it reads.
3. The stop rules decide whether the run is over.
4. The blocks with state outputs, except plants, compute their steps and publish their
   outputs.
5. The loop logs one row with the results of this tick.
6. The plants (models of the robots' motion) move on by one tick.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numba.core.errors import NumbaError
from numpy.typing import NDArray

from diagrams.building.builder import audible_sounds
from diagrams.building.robot import seed_of
from diagrams.running.audio.run_audio import RunAudio
from diagrams.running.compiled.loop_blocks import (
    LoopDiagram,
    PortKey,
    shared_blocks,
    shared_sources,
    shared_world,
)
from diagrams.running.compiled.parts import run_parts
from diagrams.running.compiled.plan import LoopPlan
from diagrams.running.referee import Referee
from diagrams.scenario.participants import Router
from diagrams.scenario.scenario import WORLD, Scenario
from diagrams.scenario.shorthand import ROBOT
from systems.framework.block import RunFacts
from systems.framework.host_step import HostError
from systems.framework.input_error import InputError, shortened
from systems.framework.signals import Emission


@dataclass
class CompiledLoop:
    """A run in compiled code that advances tick by tick."""

    log: NDArray[np.float64]
    """(ticks + 1, columns) logged values of all robots. The loop has not yet filled the
    rows from ``done`` on.
    """
    tick_s: float
    referee: Referee
    """Referee of the run, which states why the run ended."""
    columns: Mapping[str, Mapping[str, int]]
    """Indices of the columns in the log, by robot or world, and by column name."""
    plan: LoopPlan
    """The parts of a tick."""
    over: bool = False
    """Whether the run has ended."""
    done: int = 0
    """Number of logged ticks."""

    @property
    def time_s(self) -> float:
        """Time of the last logged tick, s."""
        return (self.done - 1) * self.tick_s

    def logged(self, robot: str) -> dict[str, NDArray[np.float64]]:
        """Returns the logged columns of a robot, including the time.

        ``robot`` is the name of the robot, or ``world`` for the blocks that all robots
        share. Each column has the shape (ticks,).
        """
        log = np.ascontiguousarray(self.log[: self.done].T)
        times: NDArray[np.float64] = np.arange(float(self.done)) * self.tick_s
        return {"t": times, **{n: log[k] for n, k in self.columns[robot].items()}}

    def prepare(self) -> None:
        """Compiles the code of the blocks, or loads code that was compiled earlier.

        If this process has already compiled the code, the method does nothing.

        Raises:
            InputError: numba cannot compile a user's own law or block.
        """
        try:
            self._call(1, 1)
        # numba raises different errors for different unsupported features.
        except (NumbaError, NotImplementedError, ValueError) as error:
            robots = self.referee.scenario.robots.values()
            own = [name for robot in robots for name in robot.own_code]
            if not own:
                raise
            raise InputError(
                "engine",
                f"numba cannot compile {' or '.join(map(repr, own))} "
                f"({_complaint(error)}); run with engine drake",
            ) from None

    def _call(self, begin: int, end: int) -> tuple[int, bool]:
        try:
            done: tuple[int, bool] = run_parts(
                begin, end, self.log, *self.plan.arguments
            )
        except HostError:
            raise next(host.error for host in self.plan.hosts if host.error) from None
        return done

    def advance(self, ticks: int) -> None:
        """Advances the run by a number of ticks (control periods), at most to its end.

        If a value becomes NaN or infinite, the method raises an ``InputError``.
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


def _complaint(error: Exception) -> str:
    """Returns the message of a numba error without its context lines."""
    lines = (line.strip() for line in str(error).splitlines())
    around = "During", "raised", "Failed in"
    known = (line for line in lines if line and not line.startswith(around))
    return shortened(next(known, type(error).__name__), 120)


def compile_loop(scenario: Scenario, audio: RunAudio | None = None) -> CompiledLoop:
    """Assembles the compiled loop of a scenario from the steps of its blocks.

    Args:
        scenario: The scenario to run.
        audio: Open files for the sound of the run, or None to save no sound.

    Returns:
        The loop before its first tick (control period).

    Raises:
        InputError: A user's own block has no step, or a sound file cannot be played.
    """
    ticks = int(scenario.duration_s / scenario.tick_s + 1e-9)
    times: NDArray[np.float64] = np.arange(ticks + 1.0) * scenario.tick_s
    referee, facts_of = Referee(scenario), partial(_facts, scenario, ticks)
    emitters = {
        name: made.blocks["emitter"].step_for(facts_of(name))
        for name, made in shared_sources(scenario).items()
    }
    robots: dict[str, LoopDiagram] = {}

    def emission(name: str, tick: int) -> Emission:
        """Emission of a source or robot; robots may hear one another."""
        if name in emitters:
            carried = emitters[name].carries["emission"]
        else:
            carried = robots[name].carried["emitter", "emission"]
        found: Emission = carried(tick)
        return found

    every: dict[str, LoopDiagram] = {}
    made_world = shared_world(scenario)
    if made_world is not None:
        every[WORLD] = LoopDiagram(made_world, facts_of(ROBOT), {})
    blocks = shared_blocks(scenario)
    for (name, made), pose_WB in zip(blocks.items(), referee.poses, strict=True):
        target = scenario.target(name)
        heard = {
            "emission" if source == target else f"emission_{source}": partial(
                emission, source
            )
            for source in audible_sounds(scenario)
        }
        shared = {("plant", "pose_WB"): pose_WB}
        if WORLD in every:
            shared |= _shared_with_world(every[WORLD], name)
        every[name] = robots[name] = LoopDiagram(made, facts_of(name, heard), shared)
    plan = LoopPlan(robots, times)
    for name in robots:
        plan.surround(name, scenario.surroundings(name))
    for name, emitter in emitters.items():
        plan.add_source(scenario.sources[name], emitter)
    width, columns = 0, {}
    for name, each in every.items():
        plan.add(each)
        wanted = [text for texts in each.made.columns.values() for text in texts]
        columns[name] = {text: width + k for k, text in enumerate(wanted)}
        width += len(wanted)
    if audio is not None:

        def read(tick: int, owner: str, port: str) -> Any:
            if port == "emission":
                return emission(owner, tick)
            return robots[owner].output(port, tick)

        plan.call(lambda tick, _, __: audio.save(tick, partial(read, tick)))
    plan.judge(referee)
    log = np.empty((ticks + 1, width))
    return CompiledLoop(log, scenario.tick_s, referee, columns, plan)


def _shared_with_world(
    world: LoopDiagram, robot: str
) -> dict[PortKey, NDArray[np.float64]]:
    """Values of ports by which a robot and the world are connected."""
    values = {("", port): world.values[key] for port, key in world.published.items()}
    if ("", f"frames_{robot}") in world.values:
        values["controller", "frames"] = world.values["", f"frames_{robot}"]
    return values


def _facts(
    scenario: Scenario,
    ticks: int,
    owner: str,
    carried: Mapping[str, Callable[[int], Any]] | None = None,
) -> RunFacts:
    """Facts about a run for the blocks of a robot or source; ``ROBOT``: the world."""
    own = scenario.robots.get(owner)
    goal = own.route.goal_m if isinstance(own, Router) else None
    return RunFacts(
        ticks,
        scenario.tick_s,
        own.start.pose if own is not None else (0.0, 0.0, 0.0),
        scenario.integration_step_s,
        partial(seed_of, scenario, owner=owner),
        carried or {},
        scenario.mapped(),
        goal,
    )
