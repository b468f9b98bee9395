"""Results of a sweep over control laws: statistics of each law and each pair of laws.

A sweep runs many variants of a scenario. A layout is one variant of the positions and
motions of all bodies. In a paired sweep, every law meets the same layouts with the same
seeds. The two runs of a pair therefore differ in the law only.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.comparison.all_robots import with_all_robots
from analysis.comparison.cells import LawCell, make_cell
from analysis.comparison.paired_statistics import (
    PairedMedian,
    PairedRate,
    paired_median,
    paired_rate,
)
from analysis.runs.metric_table import METRICS
from analysis.runs.run_table import collisions, column, successes
from analysis.sweeps.estimates import by_cell
from analysis.sweeps.plan import SweepPlan
from diagrams.scenario.scenario import scenario_from_mapping


@dataclass(frozen=True)
class Pair:
    """Comparison of two cells that differ in one field, layout by layout."""

    scenario: str
    field: str
    first: Any
    """Value of the field in the first cell."""
    second: Any
    fields: dict[str, Any]
    """Fields with the same value in both cells."""
    success: PairedRate
    collision: PairedRate
    metrics: dict[str, PairedMedian]
    encounters: dict[str, PairedMedian]
    """Metrics over the layouts on which both laws succeeded and both had repulsion from
    an obstacle. On other layouts, the laws differ only near the body of the source."""


@dataclass(frozen=True)
class Comparison:
    """Cells of a sweep, and the pairs of these cells."""

    cells: list[LawCell]
    pairs: list[Pair]


def compare_runs(plan: SweepPlan, table: pd.DataFrame, scenario: str) -> Comparison:
    """Summarizes a parameter sweep in which all control laws meet the same layouts.

    A layout is one variant of the positions and motions of all bodies. Rates have
    Wilson's confidence intervals. Medians have confidence intervals from order
    statistics. All intervals have a confidence of 95 %. A run that raised an error
    counts as a failure.

    Args:
        plan: Plan of the sweep. Its grid contains ``law`` and possibly other fields.
        table: Results of the sweep, from ``analysis.sweeps.store.load_results``.
        scenario: Name of the scenario.

    Returns:
        Cells and pairs. A cell combines all layouts of one law and one value of each
        other field. A pair compares two cells that differ in exactly one field.
    """
    cells = [
        make_cell(scenario, fields, rows, plan.seed)
        for fields, rows in zip(plan.cells(), _runs(plan, table), strict=True)
    ]
    pairs = [_pair(scenario, neighbours) for neighbours in _neighbours(plan, table)]
    return Comparison(cells, pairs)


def pooled_pairs(sweeps: Sequence[tuple[SweepPlan, pd.DataFrame]]) -> list[Pair]:
    """Compares each pair of values of a field over all scenarios together."""
    groups: dict[tuple[str, str, str], list[_Neighbours]] = {}
    for plan, table in sweeps:
        for one in _neighbours(plan, table):
            key = (one.field, str(one.first), str(one.second))
            groups.setdefault(key, []).append(one)
    return [_pair("all", _joined(group)) for group in groups.values()]


@dataclass(frozen=True)
class _Neighbours:
    """Runs of two cells that differ in one field, in the same order of layouts."""

    field: str
    first: Any
    second: Any
    fields: dict[str, Any]
    first_rows: pd.DataFrame
    second_rows: pd.DataFrame


def _runs(plan: SweepPlan, table: pd.DataFrame) -> list[pd.DataFrame]:
    """Rows of each cell, in the order of the layouts."""
    scenario = scenario_from_mapping(plan.base)
    robots = list(scenario.robots)
    if "tick_s" not in table:  # else it is swept or drawn
        table = table.assign(tick_s=scenario.tick_s)
    return by_cell(plan, with_all_robots(table, robots).sort_values("run"))


def _neighbours(plan: SweepPlan, table: pd.DataFrame) -> Iterator[_Neighbours]:
    rows = list(zip(plan.cells(), _runs(plan, table), strict=True))
    for (one, ones), (other, others) in combinations(rows, 2):
        apart = [key for key in one if one[key] != other[key]]
        if len(apart) == 1:
            field = apart[0]
            common = {key: value for key, value in one.items() if key != field}
            yield _Neighbours(field, one[field], other[field], common, ones, others)


def _joined(group: Sequence[_Neighbours]) -> _Neighbours:
    return replace(
        group[0],
        fields={},
        first_rows=pd.concat([one.first_rows for one in group]),
        second_rows=pd.concat([one.second_rows for one in group]),
    )


def _pair(scenario: str, runs: _Neighbours) -> Pair:
    first, second = runs.first_rows, runs.second_rows
    both = successes(first) & successes(second)
    met = both & _pushed(first) & _pushed(second)
    everywhere = np.ones(len(first), dtype=bool)
    return Pair(
        scenario=scenario,
        field=runs.field,
        first=runs.first,
        second=runs.second,
        fields=runs.fields,
        success=paired_rate(successes(first), successes(second)),
        collision=paired_rate(collisions(first), collisions(second)),
        metrics=_medians(first, second, {"ended": everywhere, "successes": both}),
        encounters=_medians(first, second, {"successes": met}),
    )


def _pushed(rows: pd.DataFrame) -> NDArray[np.bool_]:
    """(n,) whether each run had any repulsion from an obstacle."""
    return np.isfinite(column(rows, "reaction_distance_m"))


def _medians(
    first: pd.DataFrame, second: pd.DataFrame, chosen: dict[str, NDArray[np.bool_]]
) -> dict[str, PairedMedian]:
    """Compares metrics over the pairs chosen for their kind; omits those without."""
    medians = {
        name: paired_median(*(column(rows, name)[which] for rows in (first, second)))
        for name, metric in METRICS.items()
        if metric.paired and (which := chosen.get(metric.of)) is not None
    }
    return {name: median for name, median in medians.items() if median.pairs}
