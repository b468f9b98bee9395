"""What a sweep adds to its runs, what a second process brings, and its memory.

    python -m benchmarks.sweeps [--runs N] [--memory-runs N]

Prints figures beside their bounds; exit status 1 if one is missed. The second
figure needs two idle cores. The bare simulation is ``simulate`` with the build
of its diagram, without metrics, in a process that does nothing else.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.sweep import run_sweep
from analysis.sweep_plan import SweepPlan
from benchmarks.figures import Figure, print_figures
from benchmarks.process_tree import tree_usage
from diagrams import simulate

__all__ = ["SweepTrace", "memory_growth_mb", "run_cost", "speed_up", "trace_sweep"]


class SweepTrace(NamedTuple):
    """A sweep, looked at whenever a run was done."""

    times: NDArray[np.float64]
    """(n,) when, s."""
    resident_mb: NDArray[np.float64]
    """(n,) memory of all its processes, MB; where asked for, else NaN."""

    @property
    def interval_s(self) -> float:
        """Mean time from one run to the next; the start of the workers is over."""
        skip = len(self.times) // 10
        return float(np.mean(np.diff(self.times[skip:])))


def trace_sweep(plan: SweepPlan, workers: int, *, every: int = 0) -> SweepTrace:
    """Runs a sweep into a directory that is thrown away.

    Args:
        plan: What to run.
        workers: Number of processes.
        every: After how many runs the memory is read; 0: never.
    """
    times: list[float] = []
    memory: list[float] = []

    def look(done: int) -> None:
        if done > len(times):
            times.append(perf_counter())
            due = every and done % every == 0
            memory.append(tree_usage(os.getpid()).resident_mb if due else np.nan)

    with TemporaryDirectory() as folder:
        run_sweep(plan, Path(folder) / "out", workers=workers, progress=look)
    return SweepTrace(np.array(times), np.array(memory))


def run_cost(plan: SweepPlan) -> float:
    """Time of a run within a sweep of one process over that of the bare one."""
    bare = []
    for point in plan.points():
        scenario = plan.scenario_of(point)
        start = perf_counter()
        simulate(scenario)
        bare.append(perf_counter() - start)
    times = trace_sweep(plan, workers=1).times
    return float(np.median(np.diff(times)) / np.median(bare))


def speed_up(plan: SweepPlan) -> float:
    """Runs a second of two processes over those of one."""
    one, two = (trace_sweep(plan, workers=workers) for workers in (1, 2))
    return one.interval_s / two.interval_s


def memory_growth_mb(runs: int, *, every: int = 7) -> float:
    """Growth of the peak memory from the first to the last fifth of the runs, MB."""
    short = {"hearing": "ideal", "obstacle_sensing": "ideal", "duration_s": 0.1}
    plan = SweepPlan(scenario="default", set=short, runs=runs)
    memory = trace_sweep(plan, workers=2, every=every).resident_mb
    part = runs // 5
    return float(np.nanmax(memory[-part:]) - np.nanmax(memory[:part]))


def main() -> int:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--runs", type=int, default=40, help="timed runs")
    parser.add_argument("--memory-runs", type=int, default=10_000)
    arguments = parser.parse_args()
    ideal = SweepPlan(set={"hearing": "ideal"}, runs=arguments.runs)
    audio = SweepPlan(runs=max(2, arguments.runs // 4))
    return print_figures(
        [
            Figure(
                "run in a sweep over bare, ideal hearing", run_cost(ideal), "<=", 1.1
            ),
            Figure("run in a sweep over bare, full audio", run_cost(audio), "<=", 1.1),
            Figure("two processes over one", speed_up(ideal), ">=", 1.8),
            Figure(
                f"memory over {arguments.memory_runs} runs, MB",
                memory_growth_mb(arguments.memory_runs),
                "<=",
                50.0,
            ),
        ]
    )


if __name__ == "__main__":
    sys.exit(main())
