"""Real-time factors, and what the diagram adds to Drake and to its own functions."""

from __future__ import annotations

from collections.abc import Callable
from time import process_time
from typing import Any

from pydrake.systems.analysis import ApplySimulatorConfig, Simulator

from benchmarks.hollow import hollow_diagram
from benchmarks.plain_loop import PlainLoop
from diagrams import (
    Scenario,
    build_sound_follower,
    load_scenario,
    simulate,
)
from diagrams.running.simulation import simulator_config
from diagrams.scenario.run_parameters import Engine

#: Runs of each; the fastest counts, since a machine only ever adds time.
REPEATS = 3


def real_time_factor(
    overrides: tuple[str, ...], engine: Engine = "drake", name: str = "default"
) -> float:
    """Simulated over wall time of ``simulate``, without building the diagram."""
    scenario = load_scenario(name, overrides)
    follower = build_sound_follower(scenario, log=True)
    runs = [
        simulate(scenario, follower=follower, engine=engine) for _ in range(REPEATS + 1)
    ]
    return max(run.simulated_s / run.wall_s for run in runs[1:])


def compiled_speed() -> float:
    """Time of Drake's run over that of the compiled loop, results included."""
    scenario = load_scenario("default", ["hearing=ideal"])
    follower = build_sound_follower(scenario, log=True)

    def run(engine: Engine) -> float:
        start = process_time()
        simulate(scenario, follower=follower, engine=engine)
        return process_time() - start

    return _ratio(lambda: run("drake"), lambda: run("compiled"))


def overhead_of_a_run(overrides: tuple[str, ...]) -> float:
    """Time of ``simulate`` over that of the same diagram with nothing in its blocks.

    Both log every tick; the run is judged at every tick, too, and its result made.
    """
    scenario = load_scenario("default", overrides)
    follower = build_sound_follower(scenario, log=True)
    hollow = hollow_diagram(follower, log=True)

    def run() -> float:
        start = process_time()
        simulate(scenario, follower=follower)
        return process_time() - start

    return _ratio(run, lambda: _simulated(hollow, scenario))


def overhead_of_the_diagram() -> float:
    """Time of the simulation over that of its functions and of Drake itself.

    A plain loop calls the pure functions of every block in the same order, with
    the same integrator, on plain variables, and ends at the same place
    (``tests/evals/test_plain_loop.py``); the same diagram with nothing in its blocks
    is what Drake needs for them. Neither side logs or judges the run.
    """
    scenario = load_scenario("default")
    follower = build_sound_follower(scenario)
    hollow, loop = hollow_diagram(follower), PlainLoop(scenario)

    def parts() -> float:
        start = process_time()
        loop.run()
        return process_time() - start + _simulated(hollow, scenario)

    return _ratio(lambda: _simulated(follower.diagram, scenario), parts)


def _simulated(diagram: Any, scenario: Scenario) -> float:
    """Time that a diagram's run takes without judging it, s."""
    simulator = Simulator(diagram)
    ApplySimulatorConfig(simulator_config(scenario), simulator)
    simulator.Initialize()
    start = process_time()
    simulator.AdvanceTo(scenario.duration_s)
    return process_time() - start


def _ratio(of: Callable[[], float], over: Callable[[], float]) -> float:
    """Of the least times, taken in turns, the first ones left out."""
    times = [(of(), over()) for _ in range(REPEATS + 1)][1:]
    return min(time for time, _ in times) / min(time for _, time in times)
