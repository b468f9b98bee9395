"""Cells of a sweep: rates, averages, and causes of failures of their runs."""

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
#: MOST_BINS: greatest number of bins of a drawn number.
#: LEAST_RUNS: least number of runs per bin, if there is more than one bin.
MOST_BINS, LEAST_RUNS = 8, 20
#: A body was out of sight if the time from its last echo to the contact is at least
#: this number of ticks. Then there was no echo at the last tick.
OUT_OF_SIGHT_TICKS = 1.5
#: A body was heard late if its first echo came less than this time before the contact,
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
    """Seed of the sweep, for bootstrap intervals."""

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

        A rate is the share of all runs. A run that raised an error counts as a run
        without success and without collision. ``METRICS`` defines which runs an average
        of a metric includes.
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

        With the sign ``+``, positive numbers have a sign, too. Without runs, the text
        is a dash.
        """
        if self.rate:
            return estimate.text(f"{sign}.0f", factor=100.0)
        metric = METRICS.get(self.name.rpartition(".")[2])
        return estimate.text(f"{sign}.{metric.digits if metric else 3}f")


def quantities(
    rows: pd.DataFrame, *, pictures: bool = False, robot: str = "", seed: int = 0
) -> list[Quantity]:
    """Returns the rates and metrics that pages show, without those that no run has.

    With the name of a robot, the result contains the metrics of this robot and no
    rates. Otherwise, it contains the rates and the metrics of all robots together.
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
    """Position among the cell's runs, ordered by success and then by clearance."""
    index: int
    """Number of the run in the sweep."""
    cause: str


@dataclass(frozen=True)
class Cell:
    """Summary of all runs of one scenario with the same values of the grid."""

    scenario: str
    fields: dict[str, Any]
    """Values of the fields of the grid, by dotted path."""
    runs: int
    causes: dict[str, int]
    """Number of runs by cause of their end. The cause of a collision states in
    brackets who was at fault."""
    mechanisms: dict[str, int]
    """Number of failed runs by mechanism; see ``failure_mechanisms``. It is empty for
    several robots, and for a robot without range sensors."""
    success: Estimate
    collision: Estimate
    metrics: dict[str, Estimate]
    """Average of each metric, by column of the results."""
    examples: tuple[ExampleRun, ...]
    warnings: list[WarningCount]

    @property
    def label(self) -> str:
        """Short text that distinguishes the cell from the others of its scenario."""
        return cell_label(self.fields)


def make_cell(
    scenario: str, fields: dict[str, Any], rows: pd.DataFrame, seed: int = 0
) -> Cell:
    """Summarizes the runs of a cell. Their rows need the control period ``tick_s``."""
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
    """Worst, typical and best run, ordered by success and then by clearance."""
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
    """Names the mechanism by which each failed run failed; none for a success.

    The rows are results of runs with range sensors, with the control period ``tick_s``
    as an additional column.

    The mechanism of a collision depends on the echoes of the body that the robot hit
    (docs/results_laws.md):

    - ``never heard``: The body returned no echo. It came from a direction outside the
      sensor cones.
    - ``out of sight``: The body returned echoes, but none at the last tick before the
      contact (tick = control period). The body had left the cones.
    - ``heard late``: The first echo came less than 1 s before the contact.
    - ``pushed too little``: The body returned echoes in time and up to the contact.

    The other failures have these mechanisms:

    - ``jam``: The robot never reached the goal. It got stuck, or the time ran out.
    - ``held off``: The robot reached the goal and got stuck later. The repulsion from
      the source itself kept the robot outside.
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
    names = names.mask(hits, "pushed too little")
    names = names.mask(hits & (warning < LATE_S), "heard late")
    out_of_sight = unseen >= OUT_OF_SIGHT_TICKS * rows["tick_s"]
    names = names.mask(hits & out_of_sight, "out of sight")
    return names.mask(hits & warning.isna(), "never heard")


@dataclass(frozen=True)
class Marginal:
    """Estimates of a quantity as a function of one drawn field."""

    path: str
    places: NDArray[np.float64]
    """Median of the field in each bin; for choices, their indices from 0."""
    labels: tuple[str, ...]
    """Names of the choices; empty if the field is a number."""
    estimates: tuple[Estimate, ...]
    """Estimate of the quantity in each bin."""


def marginal(
    plan: SweepPlan, key: str, runs: pd.DataFrame, quantity: Quantity
) -> Marginal:
    """Estimates a quantity as a function of one randomly drawn field.

    The runs are sorted into bins by the value of the field. If the field is a number,
    the bins have about the same number of runs. Otherwise, each possible value has a
    bin. If the key in ``plan.draw`` lists several paths, the first path represents all
    of them.
    """
    path = key.partition(",")[0].strip()
    values = runs[path]
    if not plan.draw[key].numeric:
        names = sorted(set(values), key=str)
        return Marginal(
            path,
            np.arange(len(names), dtype=float),
            tuple(short(name) for name in names),
            tuple(quantity.estimate(runs[values == name]) for name in names),
        )
    count = int(np.clip(len(runs) // LEAST_RUNS, 1, MOST_BINS))
    parts = np.array_split(np.argsort(values.to_numpy(), kind="stable"), count)
    groups = [runs.iloc[part] for part in parts if len(part)]
    return Marginal(
        path,
        np.array([float(group[path].median()) for group in groups]),
        (),
        tuple(quantity.estimate(group) for group in groups),
    )


def by_cell(plan: SweepPlan, results: pd.DataFrame) -> list[pd.DataFrame]:
    """Splits the runs of a sweep by the cells of its grid, as in ``plan.cells()``."""
    return [results[results["cell"] == k] for k in range(plan.cell_count)]


def cell_label(fields: dict[str, Any]) -> str:
    """Describes a cell by the last part of each path and its value."""
    pairs = [f"{path.rpartition('.')[2]} {short(v)}" for path, v in fields.items()]
    return ", ".join(pairs) or "all runs"


def short(value: Any, most: int = 24) -> str:
    """Writes a plain value in at most ``most`` characters; dots replace the end."""
    text = value if isinstance(value, str) else json.dumps(value)
    return text if len(text) <= most else f"{text[: most - 3]}..."


def text_table(rows: Sequence[Sequence[str]]) -> list[str]:
    """Lines of a table for a terminal, with two spaces between the columns."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  ".join(text.ljust(w) for text, w in zip(row, widths, strict=True)).rstrip()
        for row in rows
    ]
