"""Measures the computing time of the guard and of the guarded law.

The guard is the block that passes a command only if the robot can still brake in free
space. The guarded law is a law that plans paths that the guard accepts.
"""

from __future__ import annotations

from collections.abc import Sequence
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.report.provenance import SCHEMA_VERSION, versions
from diagrams import load_scenario, simulate
from diagrams.running.simulation import prepared_loop


class TickCost(NamedTuple):
    """Computing time per control period."""

    what: str
    """Description of the run."""
    mean_ms: float
    """Mean time per control period, ms."""
    p99_ms: float | None
    """99 % quantile of the times, ms; None if only the whole run was timed."""
    worst_ms: float | None
    """Longest time of a control period, ms; None if only the whole run was timed."""


def tick_costs() -> list[TickCost]:
    """Measures computing times per control period.

    The scenario ``corridor`` runs with and without the guard in both engines. The
    guarded law runs in four other scenarios with two sets of range sensors.
    """
    costs = []
    for engine in ("compiled", "drake"):
        for guard in ("{}", "null"):
            fields = ["hearing=ideal", "duration_s=20", f"guard={guard}"]
            scenario = load_scenario("corridor", fields)
            runs = [simulate(scenario, engine=engine) for _ in range(3)]
            tick_s = min(run.wall_s / len(run.time) for run in runs)
            what = f"{engine}, {'no guard' if guard == 'null' else 'guard'}"
            costs.append(TickCost(what, 1e3 * tick_s, None, None))
    for name in ("clutter", "rooms", "two_moving_obstacles", "crowd"):
        for preset in ("three", "ring_12"):
            each = 1e3 * _tick_times(name, preset)
            what = f"guarded law, {name}, {preset}"
            p99, worst = float(np.quantile(each, 0.99)), float(each.max())
            costs.append(TickCost(what, float(each.mean()), p99, worst))
    return costs


def _tick_times(name: str, preset: str) -> NDArray[np.float64]:
    """(ticks,) computing times of the control periods with the guarded law, s.

    The compiled engine runs the scenario three times. For each control period, the
    least of its three times counts.
    """
    fields = ["hearing=ideal", "law=guarded", f"ultrasonic.preset={preset}"]
    scenario, times = load_scenario(name, fields), []
    for _ in range(3):
        loop, spent = prepared_loop(scenario), []
        while not loop.over:
            start = perf_counter()
            loop.advance(1)
            spent.append(perf_counter() - start)
        times.append(spent)
    return np.min(times, axis=0)


def cost_summary(costs: Sequence[TickCost]) -> dict[str, Any]:
    """Builds the JSON document of the results of ``tick_costs``."""
    return {
        "schema_version": SCHEMA_VERSION,
        "versions": versions(),
        "costs": [each._asdict() for each in costs],
    }


def cost_text(costs: Sequence[TickCost]) -> str:
    """Formats computing times for a terminal, one line each."""
    lines = []
    for what, mean, p99, worst in costs:
        rest = "" if p99 is None else f", 99 % below {p99:.1f} ms, worst {worst:.1f} ms"
        time = f"{1e3 * mean:.0f} us" if p99 is None else f"{mean:.2f} ms"
        lines.append(f"{what}: {time} per tick{rest}")
    return "\n".join(lines)
