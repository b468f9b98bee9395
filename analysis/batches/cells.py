"""Summarizes each cell of a sweep: rates, averages, and causes of failures.

A cell consists of all runs with the same combination of values in the grid of the
sweep.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal
from zlib import crc32

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.batches.plan import SweepPlan
from analysis.batches.run_rows import (
    WarningCount,
    collisions,
    column,
    successes,
    warning_counts,
)
from analysis.report.intervals import (
    Estimate,
    estimate_mean,
    estimate_median,
    estimate_rate,
)
from analysis.runs.metric_table import METRICS, metric_label
from diagrams.running.stop_rules import SUCCESSFUL

ExampleKind = Literal["worst", "typical", "best"]
EXAMPLES: tuple[ExampleKind, ...] = ("worst", "typical", "best")
#: Bins into which ``marginal`` sorts the runs by the value of a drawn number.
#: LEAST_BINS, MOST_BINS: least and greatest number of bins.
#: USUAL_RUNS: number of runs per bin between these two numbers.
LEAST_BINS, MOST_BINS, USUAL_RUNS = 4, 8, 20
#: A body was out of sight if its last echo came at least this number of ticks (control
#: periods) before the contact. The last tick before the contact then had no echo of it.
OUT_OF_SIGHT_TICKS = 1.5
#: An echo was late if the first echo came less than this time before the contact,
#: s. At the top speed of 0.72 m/s, the robot travels 0.72 m in this time.
LATE_S = 1.0
#: Columns that are averaged like metrics.
_TIMES = ("collision_time_s", "simulated_s")


@dataclass(frozen=True)
class Quantity:
    """A rate or an average that is estimated from runs."""

    name: str
    """``success``, ``collision``, or the column of a metric."""
    seed: int = 0
    """Seed of the sweep. It determines the bootstrap interval of a mean."""

    @property
    def rate(self) -> bool:
        """Whether the quantity is a rate, between 0 and 1."""
        return self.name in ("success", "collision")

    @property
    def label(self) -> str:
        """Title with the unit in brackets."""
        return f"{self.name} (%)" if self.rate else metric_label(self.name)

    def estimate(self, runs: pd.DataFrame) -> Estimate:
        """Estimates the quantity.

        A rate is the number of runs with success, or with a collision, divided by the
        number of all runs. A run that raised an error has neither. The average of a
        metric includes the runs that ``Metric.of`` states.
        """
        if self.rate:
            hits = successes if self.name == "success" else collisions
            return estimate_rate(int(np.sum(hits(runs))), len(runs))
        metric = METRICS.get(self.name.rpartition(".")[2])
        values = column(runs, self.name)
        if metric and metric.of == "successes":
            values = values[successes(runs)]
        values = values[np.isfinite(values)]
        if metric and metric.average == "mean":
            # Each metric has its own seed, so that the samples are independent.
            seed = crc32(json.dumps([self.seed, self.name]).encode())
            return estimate_mean(values, seed=seed)
        return estimate_median(values)

    def text(self, estimate: Estimate, sign: str = "") -> str:
        """Writes an estimate in the form '82 (68, 91)', with rates in percent.

        If ``sign`` is ``+``, positive numbers begin with a plus sign. If the estimate
        has no samples, the text is a dash.
        """
        if self.rate:
            return estimate.text(f"{sign}.0f", factor=100.0)
        metric = METRICS.get(self.name.rpartition(".")[2])
        return estimate.text(f"{sign}.{metric.digits if metric else 3}f")


def quantities(
    rows: pd.DataFrame, *, pictures: bool = False, robot: str = "", seed: int = 0
) -> list[Quantity]:
    """Returns the rates and metrics that pages show; omits metrics without any value.

    Args:
        rows: Table of the runs.
        pictures: Whether to omit the metrics that only tables show.
        robot: Name of one of several robots. The result then contains only the metrics
            of this robot. An empty name means the rates, and the metrics over all
            robots.
        seed: Seed of the sweep.

    Returns:
        The rates, then the metrics in the order of ``METRICS``.
    """
    prefix = f"{robot}." if robot else ""
    names = [
        f"{prefix}{name}"
        for name, metric in METRICS.items()
        if metric.shown == "picture" or (metric.shown and not pictures)
    ]
    metrics = [Quantity(name, seed) for name in names]
    rates = [] if robot else [Quantity("success"), Quantity("collision")]
    return rates + [each for each in metrics if each.estimate(rows).n]


@dataclass(frozen=True)
class ExampleRun:
    """A run of a cell that the report shows as an example."""

    kind: ExampleKind
    """Rank among the runs of the cell. A failed run ranks below a successful run. If
    both failed or both succeeded, the run with less clearance ranks lower."""
    index: int
    """Number of the run in the sweep."""
    cause: str


@dataclass(frozen=True)
class Cell:
    """Summary of all runs of one scenario in one cell."""

    scenario: str
    fields: dict[str, Any]
    """Values that the fields of the grid have in this cell, by dotted path."""
    runs: int
    causes: dict[str, int]
    """Number of runs that ended by each cause. The cause of a collision also names who
    was at fault: ``collision (robot)`` or ``collision (obstacle)``."""
    mechanisms: dict[str, int]
    """Number of failed runs by mechanism; see ``failure_mechanisms``. The mapping is
    empty for several robots, and for a robot without range sensors."""
    success: Estimate
    collision: Estimate
    metrics: dict[str, Estimate]
    """Average of each metric, by its column in the table of the runs."""
    examples: tuple[ExampleRun, ...]
    warnings: list[WarningCount]

    @property
    def label(self) -> str:
        """Short text that distinguishes the cell from the others of its scenario."""
        return cell_label(self.fields)


def make_cell(
    scenario: str, fields: dict[str, Any], rows: pd.DataFrame, seed: int = 0
) -> Cell:
    """Summarizes the runs of a cell.

    The table ``rows`` must have a column ``tick_s``, the control period in s.
    """
    metrics = {
        name: estimate
        for name in rows.columns
        if name in _TIMES or name.rpartition(".")[2] in METRICS
        if (estimate := Quantity(name, seed).estimate(rows)).n
    }
    return Cell(
        scenario=scenario,
        fields=fields,
        runs=len(rows),
        causes=_causes(rows),
        mechanisms=_mechanisms(rows),
        success=Quantity("success").estimate(rows),
        collision=Quantity("collision").estimate(rows),
        metrics=metrics,
        examples=_examples(rows),
        warnings=warning_counts(rows),
    )


def _examples(rows: pd.DataFrame) -> tuple[ExampleRun, ...]:
    """Returns the worst, the median and the best run, ranked as in ``ExampleRun``."""
    clearance = column(rows, "minimum_clearance_m")
    order = np.lexsort((clearance, successes(rows)))
    # A run that raised an error has no clearance and cannot be shown.
    order = order[np.isfinite(clearance[order])]
    if len(order) == 0:
        return ()
    chosen = order[0], order[len(order) // 2], order[-1]
    return tuple(
        ExampleRun(kind, int(rows["index"].iloc[k]), str(rows["cause"].iloc[k]))
        for kind, k in zip(EXAMPLES, chosen, strict=True)
    )


def _causes(rows: pd.DataFrame) -> dict[str, int]:
    fault = rows["collision_fault"]
    names = rows["cause"].where(
        rows["cause"] != "collision", "collision (" + fault.astype(str) + ")"
    )
    counts = names.value_counts()
    return {str(name): int(count) for name, count in sorted(counts.items())}


def _mechanisms(rows: pd.DataFrame) -> dict[str, int]:
    """Counts the failure mechanisms, most frequent first."""
    several = any(str(name).endswith(".cause") for name in rows.columns)
    if several or "contact_warning_s" not in rows:
        return {}
    counts = failure_mechanisms(rows).value_counts()
    return {str(name): int(count) for name, count in counts.items()}


def failure_mechanisms(rows: pd.DataFrame) -> pd.Series:
    """Returns why each run failed; NaN for a successful run.

    The table ``rows`` contains runs of one robot with range sensors. An additional
    column ``tick_s`` contains the control period in s.

    The reason for a collision depends on the echoes of the body that the robot hit
    (docs/results_laws.md):

    - ``no echo``: The body never caused an echo, because it was never inside the
      cone of a sensor.
    - ``out of sight``: The body caused echoes, but none at the last tick (control
      period) before the contact. The body had left the cones.
    - ``late echo``: The first echo came less than 1 s before the contact.
    - ``echo in time``: The first echo came in time, and the echoes lasted until
      the contact. But the law did not push the robot away far enough.

    The reasons for the other failures are:

    - ``jam``: The robot never reached the goal. It got stuck, or the time ran out.
    - ``held off``: The robot reached the goal, left it again, and got stuck outside.
      The law had pushed the robot away from the source.
    - ``swings``: The robot reached the goal but did not come to rest there.
    - ``lost``: The robot lost the source.
    - ``astray``: The robot did not follow the moving source for long enough.
    - ``diverged``: The robot drove too far from the source.
    - ``no way found``: The control law reported that there is no path.
    - ``failed``: The run raised an error.
    """
    cause = rows["cause"].astype("object")
    names = cause.where(~cause.isin(SUCCESSFUL))
    names = names.replace({"stuck": "jam", "timeout": "jam", "unsettled": "swings"})
    came = np.isfinite(column(rows, "time_to_goal_s"))
    names = names.mask((cause == "stuck") & came, "held off")
    hits = cause == "collision"
    warning, unseen = rows["contact_warning_s"], rows["contact_unseen_s"]
    names = names.mask(hits, "echo in time")
    names = names.mask(hits & (warning < LATE_S), "late echo")
    out_of_sight = unseen >= OUT_OF_SIGHT_TICKS * rows["tick_s"]
    names = names.mask(hits & out_of_sight, "out of sight")
    return names.mask(hits & warning.isna(), "no echo")


@dataclass(frozen=True)
class Marginal:
    """Estimates of a quantity as a function of one drawn field."""

    path: str
    """Dotted path of the field."""
    places: NDArray[np.float64]
    """Position of each bin on the axis of a plot: the median of the field in this bin.
    If the field is not a number, the positions are 0, 1, 2 and so on."""
    labels: tuple[str, ...]
    """Name of the value in each bin; empty if the field is a number."""
    estimates: tuple[Estimate, ...]
    """Estimate of the quantity in each bin."""


def marginal(
    plan: SweepPlan, key: str, runs: pd.DataFrame, quantity: Quantity
) -> Marginal:
    """Estimates a quantity as a function of one randomly drawn field.

    The runs are sorted into bins by the value of the field. If the field is a number,
    the bins have about the same number of runs. Otherwise, each value that occurs has a
    bin.

    The argument ``key`` is a key of ``plan.draw``. If it lists several paths, the
    function uses the field at the first path.
    """
    path = key.partition(",")[0].strip()
    values = runs[path]
    if not plan.draw[key].numeric:
        names = sorted(set(values), key=str)
        return Marginal(
            path,
            np.arange(len(names), dtype=float),
            tuple(value_label(path, name) for name in names),
            tuple(quantity.estimate(runs[values == name]) for name in names),
        )
    count = int(np.clip(len(runs) // USUAL_RUNS, LEAST_BINS, MOST_BINS))
    parts = np.array_split(np.argsort(values.to_numpy(), kind="stable"), count)
    groups = [runs.iloc[part] for part in parts if len(part)]
    return Marginal(
        path,
        np.array([float(group[path].median()) for group in groups]),
        (),
        tuple(quantity.estimate(group) for group in groups),
    )


def by_cell(plan: SweepPlan, results: pd.DataFrame) -> list[pd.DataFrame]:
    """Returns one table of runs per cell, in the order of ``plan.cells()``."""
    return [results[results["cell"] == k] for k in range(plan.cell_count)]


def cell_label(fields: dict[str, Any]) -> str:
    """Returns a text about a cell, for example ``law active, speed_m_s 0.2``."""
    pairs = [f"{path.rpartition('.')[2]} {short(v)}" for path, v in fields.items()]
    return ", ".join(pairs) or "all runs"


def value_label(path: str, value: Any) -> str:
    """Returns a short text for a value; the name of a world without its set."""
    return short(value.rpartition(":")[2] if path == "world" else value)


def short(value: Any, most: int = 24) -> str:
    """Writes a value with at most ``most`` characters; dots replace its end.

    The value must be one that JSON can represent.
    """
    text = value if isinstance(value, str) else json.dumps(value)
    return text if len(text) <= most else f"{text[: most - 3]}..."


def text_table(rows: Sequence[Sequence[str]]) -> list[str]:
    """Returns the lines of a table for a terminal, with two spaces between columns."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  ".join(text.ljust(w) for text, w in zip(row, widths, strict=True)).rstrip()
        for row in rows
    ]
