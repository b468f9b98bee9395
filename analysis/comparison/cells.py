"""Summary of all runs of one law on the layouts of one scenario."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.comparison.mechanisms import failure_mechanisms
from analysis.reporting.intervals import (
    bootstrap_interval,
    median_interval,
    wilson_interval,
)
from analysis.runs.metric_table import METRICS
from analysis.runs.run_table import (
    WarningCount,
    bootstrap_seed,
    collisions,
    column,
    counted,
    successes,
    warning_counts,
)

ExampleKind = Literal["worst", "typical", "best"]
EXAMPLES: tuple[ExampleKind, ...] = ("worst", "typical", "best")


@dataclass(frozen=True)
class Mean:
    """A rate or a mean, with its confidence interval."""

    estimate: float
    low: float
    high: float


@dataclass(frozen=True)
class Median:
    """A median over the runs that have the metric, with its confidence interval."""

    median: float
    low: float
    high: float
    runs: int


@dataclass(frozen=True)
class ExampleRun:
    """A run of a cell that the report shows as an example."""

    kind: ExampleKind
    """Position among the cell's runs, ordered by success and then by clearance."""
    index: int
    """Number of the run in the sweep."""
    cause: str


@dataclass(frozen=True)
class LawCell:
    """Summary of all runs of one law on the layouts of one scenario."""

    scenario: str
    law: str
    fields: dict[str, Any]
    """Values of the other fields of the grid, by dotted path."""
    runs: int
    causes: dict[str, int]
    """Number of runs by cause of their end. The cause of a collision states in
    brackets who was at fault."""
    mechanisms: dict[str, int]
    """Number of failed runs by mechanism; see ``failure_mechanisms``."""
    success: Mean
    collision: Mean
    spl: Mean | None
    """Success weighted by path length; None if the source moves."""
    metrics: dict[str, Median]
    examples: tuple[ExampleRun, ...]
    warnings: list[WarningCount] = field(default_factory=list)

    @property
    def label(self) -> str:
        """The law, followed by the values of the further fields."""
        return ", ".join([self.law, *(str(v) for v in self.fields.values())])


def make_cell(
    scenario: str, fields: dict[str, Any], rows: pd.DataFrame, seed: int
) -> LawCell:
    """Summarizes one cell of a comparison: all runs of one control law on a scenario.

    Args:
        scenario: Name of the scenario.
        fields: Values of the cell's fields by dotted path, including ``law``.
        rows: Results of the cell's runs. The table has one row for each random layout,
            always in the same order.
        seed: Seed of the bootstrap.

    Returns:
        Rates and medians with their confidence intervals, causes of the endings, and
        example runs.
    """
    others = {key: value for key, value in fields.items() if key != "law"}
    success, collision = successes(rows), collisions(rows)
    spl = column(rows, "spl")
    metrics = {}
    for name, metric in METRICS.items():
        if not metric.paired:
            continue
        values = column(rows, name)[counted(rows, metric)]
        values = values[np.isfinite(values)]
        if len(values):
            ends = median_interval(values)
            metrics[name] = Median(float(np.median(values)), *ends, len(values))
    return LawCell(
        scenario=scenario,
        law=str(fields["law"]),
        fields=others,
        runs=len(rows),
        causes=_causes(rows),
        mechanisms=_mechanisms(rows),
        success=_rate(success),
        collision=_rate(collision),
        spl=_mean(spl[np.isfinite(spl)], bootstrap_seed(seed, "spl")),
        metrics=metrics,
        examples=_examples(rows, success),
        warnings=warning_counts(rows),
    )


def _examples(rows: pd.DataFrame, success: NDArray[np.bool_]) -> tuple[ExampleRun, ...]:
    """Worst, typical and best run, ordered by success and then by clearance."""
    clearance = column(rows, "minimum_clearance_m")
    order = np.lexsort((clearance, success))
    # A run that raised an error has no clearance and cannot be shown.
    order = order[np.isfinite(clearance[order])]
    if len(order) == 0:
        return ()
    return tuple(
        ExampleRun(kind, int(rows["index"].iloc[k]), str(rows["cause"].iloc[k]))
        for kind, k in zip(
            EXAMPLES, (order[0], order[len(order) // 2], order[-1]), strict=True
        )
    )


def _causes(rows: pd.DataFrame) -> dict[str, int]:
    fault = rows["collision_fault"]
    names = rows["cause"].where(
        rows["cause"] != "collision", "collision (" + fault.astype(str) + ")"
    )
    counts = names.value_counts()
    return {str(name): int(count) for name, count in sorted(counts.items())}


def _mechanisms(rows: pd.DataFrame) -> dict[str, int]:
    """Counts the failure mechanisms, most frequent first; empty with ideal sensing."""
    if "contact_warning_s" not in rows:
        return {}
    counts = failure_mechanisms(rows).value_counts()
    return {str(name): int(count) for name, count in counts.items()}


def _rate(flags: NDArray[np.bool_]) -> Mean:
    interval = wilson_interval(int(np.sum(flags)), len(flags))
    return Mean(float(np.mean(flags)), *interval)


def _mean(values: NDArray[np.float64], seed: int) -> Mean | None:
    if len(values) == 0:
        return None
    interval = bootstrap_interval(values, np.mean, seed=seed)
    return Mean(float(np.mean(values)), *interval)
