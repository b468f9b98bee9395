"""Real-time factors, and what the diagram adds to its own pure functions."""

from __future__ import annotations

from time import perf_counter

from benchmarks.plain_loop import PlainLoop
from diagrams import build_sound_follower, load_scenario, make_simulator, simulate

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
    """Time of the simulation over that of the same functions in a plain loop.

    The loop calls the pure functions of every block in the same order, with
    the same integrator, on plain variables, and ends at the same place
    (``tests/evals/test_plain_loop.py``). Neither side logs or judges the run.
    """
    scenario = load_scenario("default")
    follower = build_sound_follower(scenario)
    loop = PlainLoop(scenario)
    simulated, plain = [], []
    for _ in range(REPEATS + 1):
        simulator = make_simulator(follower)
        simulator.Initialize()
        start = perf_counter()
        simulator.AdvanceTo(scenario.duration_s)
        simulated.append(perf_counter() - start)
        start = perf_counter()
        loop.run()
        plain.append(perf_counter() - start)
    return min(simulated) / min(plain)
