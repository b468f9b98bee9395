"""Runs a scenario and returns its result."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig

from diagrams.building.builder import SoundFollower, build_sound_follower
from diagrams.building.robot import publishes_state
from diagrams.running.audio.run_audio import RunAudio
from diagrams.running.compiled.loop import CompiledLoop, compile_loop
from diagrams.running.monitor import Monitor
from diagrams.running.run_result import RunResult, gather_result, logged_columns
from diagrams.scenario.run_parameters import Engine
from diagrams.scenario.scenario import WORLD, Scenario
from systems.framework.input_error import InputError

# Time after which a robot has heard a source that sounds from the start, s. The robot
# then follows this source.
_FIRST_TICKS_S = 0.15
# Kinds of scenarios whose compiled code this process has loaded.
_LOADED: set[tuple[object, ...]] = set()


def make_simulator(follower: SoundFollower) -> Simulator:
    """Makes a simulator of the diagram, with the integration step of the scenario."""
    simulator = Simulator(follower.diagram)
    ApplySimulatorConfig(simulator_config(follower.scenario), simulator)
    return simulator


def simulator_config(scenario: Scenario) -> SimulatorConfig:
    """The integrator of a run, as a Drake configuration."""
    return SimulatorConfig(
        integration_scheme="runge_kutta5",
        max_step_size=scenario.integration_step_s,
        use_error_control=False,
    )


def simulate(
    scenario: Scenario,
    *,
    follower: SoundFollower | None = None,
    progress: Callable[[float], None] | None = None,
    engine: Engine | None = None,
    audio: RunAudio | None = None,
    realtime_rate: float = 0.0,
) -> RunResult:
    """Runs a scenario to its end.

    Args:
        scenario: The scenario to run.
        follower: Existing diagram of the same scenario, built with ``log=True``.
            Because Drake never frees blocks written in Python, many runs in one process
            should share one diagram. Compiled runs share blocks automatically.
        progress: Function that is called once per simulated second. Its argument is the
            simulated time, s.
        engine: ``drake`` for Drake's simulator, or ``compiled`` for the same blocks in
            one compiled loop. The first compiled run takes 20 to 80 s to compile
            the blocks; the compiled code stays on the disk. None selects the engine of
            the scenario, where ``auto`` means ``drake``.
        audio: Open files for the sound of the run, or None to save no sound.
        realtime_rate: Greatest ratio of simulated time to real time. Drake's simulator
            waits if it is faster, and calls ``progress`` at every tick (control
            period). 0: as fast as possible.

    Returns:
        The result of the run.

    Raises:
        InputError: The law is not known.
        InputError: The sound file cannot be played, or a value became NaN.
        InputError: The scenario or its law cannot be compiled.
        OSError: Sound cannot be written any more.
    """
    if audio is not None:
        audio.check_unused(scenario)
    if (engine or scenario.engine) == "compiled":
        return _run_compiled(scenario, progress, audio)
    follower = follower or build_sound_follower(scenario, log=True)
    logs = [parts.log for parts in follower.robots.values()]
    if follower.scenario != scenario or None in logs:
        raise InputError(
            "simulate", "follower must be built from the same scenario with log=True"
        )
    load_compiled_code(follower)
    simulator = make_simulator(follower)
    simulator.set_target_realtime_rate(realtime_rate)
    often = progress if realtime_rate else None
    monitor = Monitor(follower, audio, often)
    simulator.set_monitor(monitor)
    start = perf_counter()
    simulator.Initialize()
    views = _python_views(follower, simulator.get_context())
    for second in range(1, math.ceil(scenario.duration_s) + 1):
        simulator.AdvanceTo(min(second, scenario.duration_s))
        if progress is not None:
            progress(simulator.get_context().get_time())
        if monitor.referee.over:
            break
    wall_s = perf_counter() - start
    views.clear()
    columns = _logged(follower, simulator)
    world = columns.pop(WORLD, {})
    return gather_result(monitor.referee, columns, wall_s, world=world)


def _logged(
    follower: SoundFollower, simulator: Simulator
) -> dict[str, dict[str, NDArray[np.float64]]]:
    """Returns the logged columns of each robot after a run, and of the shared blocks.

    Drake logs before the blocks update their states at the same instant. Outputs that
    are parts of a block's state are therefore logged one row too late. This function
    moves their columns up by one row. Each value is then in the row of the tick
    (control period) that computed it. The last row contains the values after the
    updates of the last tick.
    """
    context = simulator.get_context()
    every = {**follower.robots}
    if follower.world is not None:
        every[WORLD] = follower.world
    logs = {}
    for name, parts in every.items():
        assert parts.log is not None
        log = parts.log.FindLog(context)
        logs[name] = np.array(log.sample_times()), np.array(log.data())
    simulator.AdvancePendingEvents()  # the updates at the last tick
    for name, parts in every.items():
        rows, first = logs[name][1], 0
        for (part, port), columns in parts.logged.items():
            block, own = parts.blocks[part], rows[first : first + len(columns)]
            if publishes_state(block, port):
                own[:, :-1] = own[:, 1:]
                last = block.GetMyContextFromRoot(context)
                own[:, -1] = parts.port(part, port).Eval(last)
            first += len(columns)
    return {name: logged_columns(every[name], *logs[name]) for name in every}


def prepared_loop(scenario: Scenario, audio: RunAudio | None = None) -> CompiledLoop:
    """Compiles the loop of a scenario, or loads its compiled code.

    The function does not run any tick (control period).

    Args:
        scenario: The scenario to run.
        audio: Open files for the sound of the run, or None to save no sound.

    Returns:
        The compiled loop before its first tick.

    Raises:
        InputError: The scenario cannot be run, see ``simulate``.
    """
    loop = compile_loop(scenario, audio)
    loop.prepare()
    listens = any(robot.listens for robot in scenario.robots.values())
    kind = "compiled", *_kind(scenario)
    if listens and kind not in _LOADED:
        # A short separate run compiles the functions that the loop calls in Python.
        # It ignores errors, which the run itself raises again.
        aside = compile_loop(scenario)
        with suppress(ValueError):
            aside.advance(math.ceil(_FIRST_TICKS_S / scenario.tick_s))
        _LOADED.add(kind)
    return loop


def _run_compiled(
    scenario: Scenario,
    progress: Callable[[float], None] | None,
    audio: RunAudio | None,
) -> RunResult:
    """Runs ``simulate`` with a compiled loop."""
    loop = prepared_loop(scenario, audio)
    start = perf_counter()
    ticks_a_second = max(1, round(1.0 / scenario.tick_s))
    while not loop.over:
        loop.advance(ticks_a_second if progress else len(loop.log))
        if progress is not None:
            progress(loop.time_s)
    wall_s = perf_counter() - start
    columns = {name: loop.logged(name) for name in scenario.robots}
    world = loop.logged(WORLD) if WORLD in loop.columns else {}
    return gather_result(loop.referee, columns, wall_s, "compiled", world)


def _python_views(follower: SoundFollower, context: Any) -> list[Any]:
    """Returns Python objects for the contexts, states and outputs of all blocks.

    While the caller keeps these objects, Drake does not create them again for each call
    of a block. This saves 5 % of the time of a run.
    """
    views: list[Any] = []
    for parts in (*follower.sources.values(), *follower.robots.values()):
        for part, block in parts.blocks.items():
            own = block.GetMyContextFromRoot(context)
            groups = range(own.num_discrete_state_groups())
            views += [own, *(own.get_discrete_state(group) for group in groups)]
            if own.num_continuous_states():
                views.append(own.get_continuous_state_vector())
            logged = (name for owner, name in parts.logged if owner == part)
            views += [parts.port(part, name).EvalBasicVector(own) for name in logged]
    return views


def load_compiled_code(follower: SoundFollower) -> None:
    """Compiles or loads the numba code that a diagram needs, by running a few ticks.

    If an earlier process has compiled the code, numba loads it from the disk. Loading
    takes about a tenth of the computing time of a run of 40 s. Compiling takes many
    times longer. Neither counts as simulation time.

    ``simulate`` calls this function once per process for each kind of diagram. A
    process that forks should call it before the fork.

    Args:
        follower: The diagram of a scenario.

    Raises:
        InputError: The scenario cannot be run, see ``simulate``.
    """
    kind = _kind(follower.scenario)
    if kind not in _LOADED:
        simulator = make_simulator(follower)
        simulator.Initialize()
        simulator.AdvanceTo(min(_FIRST_TICKS_S, follower.scenario.duration_s))
        _LOADED.add(kind)


def _kind(scenario: Scenario) -> tuple[object, ...]:
    """The properties of a scenario that determine which compiled functions it needs."""
    return tuple(
        (
            robot.law,
            robot.listens,
            getattr(robot, "obstacle_sensing", ""),
            scenario.room is None,
            robot.plant.friction is None,
            robot.own_guard is None,
        )
        for robot in scenario.robots.values()
    )
