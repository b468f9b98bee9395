"""Whether compiled loops run as Drake does, on random layouts of the whole library.

    python -m studies compiled_runs [--layouts N] [--workers N]

Prints for each scenario and law the runs that end by another cause or at another tick,
and the largest difference of a place; exit status 1 where one is beyond 1e-9 m.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from typing import NamedTuple

import numpy as np

from analysis.batches.comparison_plans import comparison_plan, library_layouts
from diagrams import RunResult, simulate
from studies.tables import MissedBoundError, Table
from systems.laws.catalog import LAWS

#: Beyond this places differ, m.
TOLERANCE_M = 1e-9


class Agreement(NamedTuple):
    """How the runs of one law on the layouts of one scenario agree."""

    scenario: str
    law: str
    runs: int
    apart: int
    """Runs with another cause, collision or last tick."""
    error_m: float
    """Largest difference of a place of the robot in all others, m."""


def agreement(scenario: str, law: str, layouts: int) -> Agreement:
    """Runs layouts with both engines.

    Args:
        scenario: Name of layouts of the library.
        law: Of the robot.
        layouts: How many.

    Returns:
        What differs.
    """
    plan = comparison_plan(
        scenario, laws=[law], runs=layouts, settings={"hearing": "ideal"}
    )
    errors, apart = [0.0], 0
    for point in plan.points():
        drawn = plan.scenario_of(point)
        drake, compiled = (simulate(drawn, engine=e) for e in ("drake", "compiled"))
        if _ending(drake) != _ending(compiled):
            apart += 1
            continue
        errors.append(float(np.max(np.abs(drake.poses("WB") - compiled.poses("WB")))))
    return Agreement(scenario, law, layouts, apart, max(errors))


def _ending(result: RunResult) -> tuple[object, ...]:
    hit = result.collision
    return result.cause, len(result.time), hit and (hit.object, hit.fault, hit.time)


def _all(layouts: int, workers: int) -> Iterator[Agreement]:
    # Drake never frees blocks written in Python: a process for each.
    with ProcessPoolExecutor(workers, max_tasks_per_child=1) as pool:
        cases = list(product(library_layouts(), LAWS))
        yield from pool.map(
            agreement, *zip(*cases, strict=True), [layouts] * len(cases)
        )


def add_options(parser: argparse.ArgumentParser) -> None:
    """Options of the study."""
    parser.add_argument("--layouts", type=int, default=200)
    parser.add_argument("--workers", type=int, default=1)


def run(options: argparse.Namespace) -> Iterator[Table]:
    """The table."""
    apart: list[str] = []

    def rows() -> Iterator[Sequence[object]]:
        for found in _all(options.layouts, options.workers):
            if found.apart or found.error_m > TOLERANCE_M:
                apart.append(f"{found.scenario}, {found.law}")
            yield (*found[:-1], f"{found.error_m:.1e}")

    head = ("scenario", "law", "runs", "end otherwise", "places differ by, m")
    yield Table("both engines", head, rows())
    if apart:
        raise MissedBoundError("; ".join(apart))
