"""What a sweep over laws says: each law's figures, and the laws in pairs.

Every law meets the same layouts with the same seeds, so that pairs of runs
differ in nothing but the law.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from itertools import combinations
from typing import Any, Literal
from zlib import crc32

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.intervals import Interval, bootstrap_interval, wilson_interval
from analysis.paired_statistics import (
    PairedMedian,
    PairedRate,
    paired_median,
    paired_rate,
)
from analysis.sweep_plan import SweepPlan

__all__ = [
    "ALL_RUNS",
    "SUCCESSES",
    "Cell",
    "Comparison",
    "Estimate",
    "ExampleRun",
    "Median",
    "Pair",
    "compare_runs",
]

ExampleKind = Literal["worst", "typical", "best"]
EXAMPLES: tuple[ExampleKind, ...] = ("worst", "typical", "best")
#: Causes of a run that did what it should.
SUCCESSFUL = ("reached", "completed")
#: Figures that any run has, however it ended.
ALL_RUNS = (
    "minimum_clearance_m",
    "minimum_obstacle_clearance_m",
    "minimum_time_to_contact_s",
    "reaction_distance_m",
)
#: Figures that a collision or a jam would cut short: of successful runs alone.
SUCCESSES = (
    "time_to_goal_s",
    "path_length_m",
    "following_fraction",
    "following_error_rms_m",
    "following_error_p95_m",
    "jerk_rms_m_s3",
    "jerk_max_m_s3",
    "angular_jerk_rms_rad_s3",
    "sparc",
    "ldlj",
    "turn_reversals_per_s",
    "heading_change_rad_m",
    "control_effort_rms_n",
    "wheel_variation_m_s2",
    "saturated_fraction",
)


@dataclass(frozen=True)
class Estimate:
    """A rate or a mean with its interval."""

    estimate: float
    low: float
    high: float


@dataclass(frozen=True)
class Median:
    """A median with its interval, over the runs that have the figure."""

    median: float
    low: float
    high: float
    runs: int


@dataclass(frozen=True)
class ExampleRun:
    """A run to look at."""

    kind: ExampleKind
    """Its place among the cell's runs, ordered by success, then by clearance."""
    index: int
    """Its number in the sweep."""
    cause: str


@dataclass(frozen=True)
class Cell:
    """All runs of one law on one experiment's layouts."""

    scenario: str
    law: str
    fields: dict[str, Any]
    """Further fields of the grid, with their values."""
    runs: int
    causes: dict[str, int]
    """How many runs ended so; collisions with whose fault it was in brackets."""
    success: Estimate
    collision: Estimate
    spl: Estimate | None
    """Success weighted by path length; none where the source moves."""
    metrics: dict[str, Median]
    examples: tuple[ExampleRun, ...]

    @property
    def label(self) -> str:
        """The law, and what else sets the cell apart."""
        return ", ".join([self.law, *(str(v) for v in self.fields.values())])


@dataclass(frozen=True)
class Pair:
    """Two cells that differ in one field, run by run."""

    scenario: str
    field: str
    first: Any
    """Value of the field in the first cell."""
    second: Any
    fields: dict[str, Any]
    """What both cells have in common."""
    success: PairedRate
    collision: PairedRate
    metrics: dict[str, PairedMedian]


@dataclass(frozen=True)
class Comparison:
    """A sweep's cells and pairs."""

    cells: list[Cell]
    pairs: list[Pair]


def compare_runs(plan: SweepPlan, table: pd.DataFrame, scenario: str) -> Comparison:
    """Summarises a paired sweep over laws.

    Rates have Wilson's intervals, medians bootstrapped ones (95 %). A run that
    raised an error counts as no success.

    Args:
        plan: Its grid has ``law``, and perhaps more fields.
        table: Its results; see ``analysis.sweep_store.load_results``.
        scenario: Name of the experiment.
    """
    grid = plan.cells()
    runs = [table[table["cell"] == k].sort_values("run") for k in range(len(grid))]
    cells = [
        _cell(scenario, fields, rows, plan.seed)
        for fields, rows in zip(grid, runs, strict=True)
    ]
    pairs = []
    for one, other in combinations(range(len(grid)), 2):
        apart = [key for key in grid[one] if grid[one][key] != grid[other][key]]
        if len(apart) == 1:
            common = {k: v for k, v in grid[one].items() if k != apart[0]}
            values = grid[one][apart[0]], grid[other][apart[0]]
            rates, medians = _compare(runs[one], runs[other], plan.seed)
            pairs.append(Pair(scenario, apart[0], *values, common, *rates, medians))
    return Comparison(cells, pairs)


def _cell(scenario: str, fields: dict[str, Any], rows: pd.DataFrame, seed: int) -> Cell:
    others = {key: value for key, value in fields.items() if key != "law"}
    success, collision = _success(rows), _collision(rows)
    spl = _column(rows, "spl")
    metrics = {}
    for name in (*ALL_RUNS, *SUCCESSES):
        values = _column(rows, name)
        if name in SUCCESSES:
            values = values[success]
        values = values[np.isfinite(values)]
        if len(values):
            interval = bootstrap_interval(values, seed=_stream(seed, name))
            metrics[name] = Median(float(np.median(values)), *interval, len(values))
    return Cell(
        scenario=scenario,
        law=str(fields["law"]),
        fields=others,
        runs=len(rows),
        causes=_causes(rows),
        success=_rate(success),
        collision=_rate(collision),
        spl=_mean(spl[np.isfinite(spl)], _stream(seed, "spl")),
        metrics=metrics,
        examples=_examples(rows, success),
    )


def _compare(
    first: pd.DataFrame, second: pd.DataFrame, seed: int
) -> tuple[tuple[PairedRate, PairedRate], dict[str, PairedMedian]]:
    rates = (
        paired_rate(_success(first), _success(second)),
        paired_rate(_collision(first), _collision(second)),
    )
    both = _success(first) & _success(second)
    medians = {}
    for name in (*ALL_RUNS, *SUCCESSES):
        one, other = _column(first, name), _column(second, name)
        if name in SUCCESSES:
            one, other = one[both], other[both]
        medians[name] = paired_median(one, other, seed=_stream(seed, name))
    return rates, {name: m for name, m in medians.items() if m.pairs}


def _examples(rows: pd.DataFrame, success: NDArray[np.bool_]) -> tuple[ExampleRun, ...]:
    """First, middle and last of the runs by success, then by clearance."""
    clearance = _column(rows, "minimum_clearance_m")
    order = np.lexsort((clearance, success))
    # A run that raised an error has no clearance, and nothing to look at.
    order = order[np.isfinite(clearance[order])]
    if len(order) == 0:
        return ()
    return tuple(
        ExampleRun(kind, int(rows["index"].iloc[k]), str(rows["cause"].iloc[k]))
        for kind, k in zip(
            EXAMPLES, (order[0], order[len(order) // 2], order[-1]), strict=True
        )
    )


def _success(rows: pd.DataFrame) -> NDArray[np.bool_]:
    return rows["cause"].isin(SUCCESSFUL).to_numpy()


def _collision(rows: pd.DataFrame) -> NDArray[np.bool_]:
    return (rows["cause"] == "collision").to_numpy()


def _causes(rows: pd.DataFrame) -> dict[str, int]:
    fault = rows["collision_fault"]
    names = rows["cause"].where(
        rows["cause"] != "collision", "collision (" + fault.astype(str) + ")"
    )
    counts = names.value_counts()
    return {str(name): int(count) for name, count in sorted(counts.items())}


def _column(rows: pd.DataFrame, name: str) -> NDArray[np.float64]:
    """The figure of each run; NaN where it has none."""
    if name not in rows:
        return np.full(len(rows), np.nan)
    return rows[name].to_numpy(dtype=float)


def _rate(flags: NDArray[np.bool_]) -> Estimate:
    interval = wilson_interval(int(np.sum(flags)), len(flags))
    return Estimate(float(np.mean(flags)), *interval)


def _mean(values: NDArray[np.float64], seed: int) -> Estimate | None:
    if len(values) == 0:
        return None
    interval: Interval = bootstrap_interval(values, np.mean, seed=seed)
    return Estimate(float(np.mean(values)), *interval)


def _stream(seed: int, name: str) -> int:
    """Seed of a figure's own bootstrap."""
    return crc32(json.dumps([seed, name]).encode())
