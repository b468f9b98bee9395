"""Compares cells of a paired sweep, run by run.

A cell of a sweep is one combination of the values in its grid. A layout is one variant
of the positions and motions of all bodies. A paired sweep runs every cell on the same
layouts with the same seeds. Two runs on the same layout therefore differ only in the
fields of the grid.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from analysis.batches.cells import by_cell
from analysis.batches.plan import SweepPlan
from analysis.batches.run_rows import collisions, column, successes
from analysis.report.intervals import LEVEL, Estimate, estimate_median
from analysis.runs.metric_table import METRICS


@dataclass(frozen=True)
class PairedRate:
    """Comparison of how often two methods had an outcome on the same layouts.

    A method is, for example, a control law. An outcome is, for example, a collision. A
    pair consists of the two runs on one layout.
    """

    only_first: int
    """Number of pairs in which only the first method had the outcome."""
    only_second: int
    """Number of pairs in which only the second method had the outcome."""
    difference: Estimate
    """Rate of the first method minus rate of the second method."""
    p_value: float
    """Two-sided p-value of the exact McNemar test that both rates are equal."""


@dataclass(frozen=True)
class PairedMedian:
    """Comparison of the values of a metric of two methods on the same layouts."""

    first: float
    """Median of the values of the first method, over the pairs."""
    second: float
    """Median of the values of the second method, over the pairs."""
    difference: Estimate
    """Median of the differences over the pairs: first value minus second value."""
    p_value: float
    """Two-sided p-value of the Wilcoxon signed-rank test that the differences are
    symmetric about zero."""


@dataclass(frozen=True)
class Pair:
    """Comparison of two cells that differ in one field, layout by layout."""

    scenario: str
    field: str
    """Dotted path of the field in which the cells differ."""
    first: Any
    """Value of this field in the first cell."""
    second: Any
    """Value of this field in the second cell."""
    fields: dict[str, Any]
    """Values that both cells have in common, by dotted path of the field."""
    success: PairedRate
    collision: PairedRate
    metrics: dict[str, PairedMedian]
    encounters: dict[str, PairedMedian]
    """Metrics over the layouts on which both runs succeeded and an obstacle repelled
    the robot in both runs. Without this repulsion, laws differ only near the body of
    the source."""

    @property
    def label(self) -> str:
        """Both values of the field, and the values that the cells have in common."""
        common = "".join(f", {value}" for value in self.fields.values())
        return f"{self.first} less {self.second}{common}"


def pairs_of(plan: SweepPlan, rows: pd.DataFrame, scenario: str) -> list[Pair]:
    """Compares any two cells of a paired sweep that differ in exactly one field.

    The rows of each cell must be sorted by layout.
    """
    return [_pair(scenario, each) for each in _neighbors(plan, rows)]


def pooled_pairs(sweeps: Sequence[tuple[SweepPlan, pd.DataFrame]]) -> list[Pair]:
    """Compares any two values of a field over the runs of several scenarios together.

    Each element of ``sweeps`` is the plan of a paired sweep and the table of its runs.
    """
    groups: dict[tuple[str, str, str], list[_Neighbors]] = {}
    for plan, rows in sweeps:
        for one in _neighbors(plan, rows):
            key = (one.field, str(one.first), str(one.second))
            groups.setdefault(key, []).append(one)
    return [_pair("all", _joined(group)) for group in groups.values()]


@dataclass(frozen=True)
class _Neighbors:
    """Runs of two cells that differ in one field, in the same order of layouts."""

    field: str
    first: Any
    second: Any
    fields: dict[str, Any]
    first_rows: pd.DataFrame
    second_rows: pd.DataFrame


def _neighbors(plan: SweepPlan, rows: pd.DataFrame) -> Iterator[_Neighbors]:
    cells = list(zip(plan.cells(), by_cell(plan, rows), strict=True))
    for (one, ones), (other, others) in combinations(cells, 2):
        apart = [key for key in one if one[key] != other[key]]
        if len(apart) == 1:
            field = apart[0]
            common = {key: value for key, value in one.items() if key != field}
            yield _Neighbors(field, one[field], other[field], common, ones, others)


def _joined(group: Sequence[_Neighbors]) -> _Neighbors:
    return replace(
        group[0],
        fields={},
        first_rows=pd.concat([one.first_rows for one in group]),
        second_rows=pd.concat([one.second_rows for one in group]),
    )


def _pair(scenario: str, runs: _Neighbors) -> Pair:
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
    first: pd.DataFrame, second: pd.DataFrame, chosen: Mapping[str, NDArray[np.bool_]]
) -> dict[str, PairedMedian]:
    """Compares the metrics of two cells, over those layouts that count for the metric.

    The flags ``chosen[metric.of]`` (n,) tell which of the n layouts count.
    """
    medians = {
        name: paired_median(column(first, name)[layouts], column(second, name)[layouts])
        for name, metric in METRICS.items()
        if metric.paired and (layouts := chosen.get(metric.of)) is not None
    }
    return {name: median for name, median in medians.items() if median is not None}


def paired_rate(
    first: ArrayLike, second: ArrayLike, *, level: float = LEVEL
) -> PairedRate:
    """Compares how often two methods have an outcome, for example a collision.

    The arguments ``first`` and ``second`` are (n,) flags, n >= 1. They tell whether
    each method had the outcome on each of the same n layouts. The confidence interval
    is the adjusted Wald interval of Bonett and Price (2012). This interval keeps its
    coverage even for rare outcomes and small samples. The p-value is that of the exact
    McNemar test.
    """
    from scipy.stats import binomtest, norm

    a, b = np.asarray(first, dtype=bool), np.asarray(second, dtype=bool)
    only_first, only_second = int(np.sum(a & ~b)), int(np.sum(~a & b))
    apart, pairs = only_first + only_second, len(a)
    p_value = binomtest(only_first, apart).pvalue if apart else 1.0
    up, down = (only_first + 1) / (pairs + 2), (only_second + 1) / (pairs + 2)
    center = up - down
    spread = math.sqrt((up + down - center**2) / (pairs + 2))
    half = float(norm.ppf(0.5 + level / 2.0)) * spread
    difference = Estimate(
        (only_first - only_second) / pairs,
        max(center - half, -1.0),
        min(center + half, 1.0),
        pairs,
        level,
    )
    return PairedRate(only_first, only_second, difference, float(p_value))


def paired_median(
    first: ArrayLike, second: ArrayLike, *, level: float = LEVEL
) -> PairedMedian | None:
    """Compares the values (n,) of a metric between two methods on the same n layouts.

    NaN means that a run has no value. Only layouts with values of both methods count.
    The p-value is that of the Wilcoxon signed-rank test. The result is None if no
    layout has values of both methods.
    """
    from scipy.stats import wilcoxon

    a, b = np.asarray(first, dtype=float), np.asarray(second, dtype=float)
    both = np.isfinite(a) & np.isfinite(b)
    differences = a[both] - b[both]
    if len(differences) == 0:
        return None
    apart = np.any(differences != 0.0)
    return PairedMedian(
        first=float(np.median(a[both])),
        second=float(np.median(b[both])),
        difference=estimate_median(differences, level=level),
        p_value=float(wilcoxon(differences).pvalue) if apart else 1.0,
    )
