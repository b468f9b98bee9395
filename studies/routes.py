"""How robots on routes arrive and collide, by law.

``python -m studies routes [RUNS]`` prints the table of docs/results_routes.md; RUNS
layouts of each scenario, 200 unless told.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from analysis.batches.comparison_plans import library_layouts
from analysis.batches.plan import load_sweep
from analysis.report.intervals import estimate_rate
from diagrams import simulate
from studies.tables import Table
from systems.laws.catalog import ROUTE_LAWS

#: Of the layouts.
SEED = 2026
#: Of the library, those whose robots have routes.
SCENARIOS = (
    "unknown_block",
    "crossing_obstacle",
    "unknown_wall",
    "unknown_u",
    "known_u",
    "mapped_room",
    "head_on",
    "robots_2",
    "robots_3",
    "robots_4",
    "robots_8",
)


def outcomes(
    scenario: str,
    law: str,
    runs: int,
    seed: int = SEED,
    settings: Mapping[str, Any] | None = None,
) -> Counter[str]:
    """How runs of random layouts ended.

    Args:
        scenario: Name in the library.
        law: Of all robots.
        runs: Layouts.
        seed: Of all of them; the same layouts for each law.
        settings: Fields of the scenario that differ.

    Returns:
        Causes and how often each was; of several robots that of the first which did
        not do what it should.
    """
    plan = load_sweep(library_layouts()[scenario])
    fields = {
        "set": {**plan.set, "law": law, **(settings or {})},
        "runs": runs,
        "seed": seed,
    }
    plan = plan.model_copy(update=fields)
    return Counter(
        simulate(plan.scenario_of(point), engine="compiled").cause
        for point in plan.points()
    )


def routes_table(runs: int) -> Table:
    """Collisions and goals reached, of all laws of robots on routes.

    Args:
        runs: Layouts of each scenario.

    Returns:
        A row a scenario: collisions, % with 95 % intervals, then goals reached, %.
    """

    def rows() -> Iterator[Sequence[str]]:
        for scenario in SCENARIOS:
            found = [outcomes(scenario, law, runs) for law in ROUTE_LAWS]
            yield f"`{scenario}`", *(outcomes_cell(each, runs) for each in found)

    return Table("routes", ["layouts", *(f"`{law}`" for law in ROUTE_LAWS)], rows())


def outcomes_cell(causes: Counter[str], runs: int) -> str:
    """What the tables say of some runs.

    Args:
        causes: As ``outcomes``.
        runs: How many there were.

    Returns:
        Collisions, % with the 95 % interval, then goals reached, %.
    """
    hits = estimate_rate(causes["collision"], runs)
    share, low, high = (100.0 * each for each in (hits.value, *hits.ends))
    reached = 100.0 * causes["reached"] / runs
    return f"{share:.1f} ({low:.1f} to {high:.1f}); {reached:.1f} %"


def add_options(parser: argparse.ArgumentParser) -> None:
    """Options of the study."""
    parser.add_argument("runs", nargs="?", type=int, default=200)


def run(options: argparse.Namespace) -> Iterator[Table]:
    """The table."""
    yield routes_table(options.runs)
