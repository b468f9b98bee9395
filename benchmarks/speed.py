"""Real-time factors, and what the diagram adds to its own pure functions."""

from __future__ import annotations

from time import perf_counter

from benchmarks.plain_loop import run_plain_loop
from diagrams import Scenario, build_sound_follower, load_scenario, simulate

__all__ = ["diagram_overhead", "real_time_factor"]

#: Runs of each; the fastest counts, since a machine only ever adds time.
REPEATS = 3


def real_time_factor(overrides: tuple[str, ...]) -> float:
    """Simulated over wall time of ``simulate``, without building the diagram."""
    scenario = load_scenario("default", overrides)
    follower = build_sound_follower(scenario, log=True)
    runs = [simulate(scenario, follower=follower) for _ in range(REPEATS + 1)]
    return max(run.simulated_s / run.wall_s for run in runs[1:])


def diagram_overhead() -> float:
    """Time of the run over that of the same functions in a plain loop.

    The loop calls the pure functions of every block in the same order, with
    the same integrator, on plain variables. Both end at the same place.
    """
    scenario = load_scenario("default")
    return min(_simulation(scenario)) / min(_loop(scenario))


def _simulation(scenario: Scenario) -> list[float]:
    follower = build_sound_follower(scenario, log=True)
    return [simulate(scenario, follower=follower).wall_s for _ in range(REPEATS + 1)]


def _loop(scenario: Scenario) -> list[float]:
    times = []
    for _ in range(REPEATS + 1):
        start = perf_counter()
        run_plain_loop(scenario)
        times.append(perf_counter() - start)
    return times
