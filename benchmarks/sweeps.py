"""What a sweep adds to its runs, what a second process brings, and its memory.

    python -m benchmarks.sweeps [--runs N] [--memory-runs N]

Prints figures beside their bounds; exit status 1 if one is missed. That of two
processes needs two idle cores. The bare simulation is ``simulate`` with the build
of its diagram, without metrics, in a process that does nothing else.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter, process_time
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.batches.one_run import Task, run_task
from analysis.batches.plan import SweepPlan
from analysis.batches.sweep import prepare_sweep
from benchmarks.process_tree import tree_usage
from diagrams import simulate
from diagrams.scenario.run_parameters import Engine
from studies.support.figures import Figure, print_figures

ENGINES: tuple[Engine, ...] = ("drake", "compiled")


class SweepTrace(NamedTuple):
    """A sweep, looked at now and then when a run was done."""

    done: NDArray[np.float64]
    """(n,) runs that were done."""
    times: NDArray[np.float64]
    """(n,) when, s."""
    processor_s: NDArray[np.float64]
    """(n,) processor time of all its processes, s."""
    resident_mb: NDArray[np.float64]
    """(n,) memory of all its processes, MB."""

    def cost_s(self) -> tuple[float, float]:
        """Time and processor time for each run, once the workers have started."""
        runs = self.done[-1] - self.done[0]
        return np.ptp(self.times) / runs, np.ptp(self.processor_s) / runs


def trace_sweep(plan: SweepPlan, workers: int, *, every: int) -> SweepTrace:
    """Runs a sweep into a directory that is thrown away.

    Args:
        plan: What to run.
        workers: Number of processes.
        every: After how many runs it is looked at.
    """
    rows: list[tuple[float, ...]] = []

    def look(done: int) -> None:
        if done and done % every == 0 and (not rows or done > rows[-1][0]):
            usage = tree_usage(os.getpid())
            rows.append((done, perf_counter(), usage.processor_s, usage.resident_mb))

    with TemporaryDirectory() as folder:
        prepare_sweep(plan, Path(folder) / "out", workers=workers).run(look)
    return SweepTrace(*np.array(rows).T)


def run_cost(plan: SweepPlan) -> tuple[float, float]:
    """A run within a sweep of one process over the bare one: time, processor time."""
    points = plan.points()
    simulate(plan.scenario_of(points[0]))
    start, processor_start = perf_counter(), process_time()
    for point in points:
        simulate(plan.scenario_of(point))
    bare = (perf_counter() - start, process_time() - processor_start)
    costs = trace_sweep(plan, workers=1, every=2).cost_s()
    return costs[0] * len(points) / bare[0], costs[1] * len(points) / bare[1]


def row_ratio(plan: SweepPlan) -> float:
    """Processor time of a row by Drake over that of a compiled one, all in."""
    points, times = plan.points(), []
    for engine in ENGINES:
        tasks = [
            Task(point, plan.scenario_of(point), engine, trajectory=False)
            for point in points
        ]
        run_task(tasks[0])
        start = process_time()
        for task in tasks:
            run_task(task)
        times.append(process_time() - start)
    return times[0] / times[1]


def speed_up(plan: SweepPlan) -> tuple[float, float]:
    """Two processes over one: runs a second, and processor time a run."""
    (one, one_cpu), (two, two_cpu) = (
        trace_sweep(plan, workers=workers, every=2).cost_s() for workers in (1, 2)
    )
    return one / two, two_cpu / one_cpu


def memory_growth_mb(runs: int, *, every: int = 7, engine: str = "drake") -> float:
    """Growth of the peak memory from the first to the second half of the runs, MB.

    Each half must see processes renewed: at least 50 runs in each of two with Drake.
    """
    short = {"hearing": "ideal", "obstacle_sensing": "ideal", "duration_s": 0.1}
    plan = SweepPlan(scenario="default", set={**short, "engine": engine}, runs=runs)
    memory = trace_sweep(plan, workers=2, every=every).resident_mb
    half = len(memory) // 2
    return float(np.max(memory[half:]) - np.max(memory[:half]))


def main() -> int:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--runs", type=int, default=40, help="timed runs")
    parser.add_argument("--memory-runs", type=int, default=10_000)
    arguments = parser.parse_args()
    ideal = SweepPlan(set={"hearing": "ideal"}, runs=arguments.runs)
    audio = SweepPlan(runs=max(2, arguments.runs // 4))
    time_ideal, processor_ideal = run_cost(ideal)
    time_audio, processor_audio = run_cost(audio)
    faster, processor_two = speed_up(ideal)
    growth = memory_growth_mb(arguments.memory_runs)
    compiled_growth = memory_growth_mb(10 * arguments.memory_runs, engine="compiled")
    return print_figures(
        [
            Figure("run over bare, ideal hearing", time_ideal, "<=", 1.1),
            Figure("the same, processor time", processor_ideal, "<=", 1.1),
            Figure("run over bare, full audio", time_audio, "<=", 1.1),
            Figure("the same, processor time", processor_audio, "<=", 1.1),
            Figure("row by Drake over compiled one", row_ratio(ideal), ">=", 20.0),
            Figure("two processes over one", faster, ">=", 1.8),
            Figure("the same, processor time a run", processor_two, "<=", 1.1),
            Figure(f"memory, {arguments.memory_runs} runs, MB", growth, "<=", 50.0),
            Figure("ten times as many, compiled, MB", compiled_growth, "<=", 50.0),
        ]
    )


if __name__ == "__main__":
    sys.exit(main())
