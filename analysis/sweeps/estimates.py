"""Estimates with confidence intervals from the runs of a sweep."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.reporting.intervals import Estimate, median_interval, wilson_interval
from analysis.runs.metric_table import METRICS
from analysis.runs.run_table import counted
from analysis.sweeps.one_run import FAILED
from analysis.sweeps.plan import SweepPlan
from diagrams.running.stop_rules import SUCCESSFUL

#: MOST_BINS: greatest number of bins of a drawn number.
#: LEAST_RUNS: least number of runs per bin, if there is more than one bin.
MOST_BINS, LEAST_RUNS = 8, 20


@dataclass(frozen=True)
class Quantity:
    """A rate or a median that is estimated from runs."""

    name: str
    """Key in JSON documents."""
    title: str
    """Title in pictures, with the unit."""
    causes: tuple[str, ...] = ()
    """Causes of the end of a run. The quantity is the fraction of runs that end by one
    of them. If empty, the quantity is the median of a metric."""
    metric: str = ""
    """Column of the metric in the results."""

    @property
    def rate(self) -> bool:
        """Whether the quantity is a rate, between 0 and 1, instead of a median."""
        return bool(self.causes)

    def estimate(self, runs: pd.DataFrame) -> Estimate:
        """Estimates the quantity from runs that came to an end; see ``ended``."""
        nothing = Estimate(np.nan, np.nan, np.nan)
        if self.rate:
            count = int(runs["cause"].isin(self.causes).sum())
            if runs.empty:
                return nothing
            return Estimate(count / len(runs), *wilson_interval(count, len(runs)))
        if self.metric not in runs:
            return nothing
        known = METRICS.get(self.metric.rpartition(".")[2])
        chosen = counted(runs, known) if known else np.ones(len(runs), dtype=bool)
        values = runs[self.metric][chosen].dropna().to_numpy()
        if not len(values):
            return nothing
        return Estimate(float(np.median(values)), *median_interval(values))


#: Quantities that pages and pictures show for one robot; see ``quantities``.
QUANTITIES = (
    Quantity("success", "runs that end well", causes=SUCCESSFUL),
    Quantity("collision", "runs that end in a collision", causes=("collision",)),
    *(
        Quantity(name, f"{metric.title}, median ({metric.unit})", metric=name)
        for name, metric in METRICS.items()
        if metric.shown == "picture"
    ),
)


def quantities(results: pd.DataFrame) -> tuple[Quantity, ...]:
    """Returns the quantities to show that the runs have, of each robot separately."""
    shown_: list[Quantity] = []
    for quantity in QUANTITIES:
        ending = f".{quantity.metric}"
        robots = [
            column.removesuffix(ending)
            for column in results.columns
            if column.endswith(ending) and not quantity.rate
        ]
        shown_ += [
            Quantity(
                f"{robot}.{quantity.name}",
                f"{robot}: {quantity.title}",
                metric=f"{robot}{ending}",
            )
            for robot in robots
        ] or [quantity]
    return tuple(
        quantity
        for quantity in shown_
        if quantity.rate or not math.isnan(quantity.estimate(results).value)
    )


def ended(results: pd.DataFrame) -> pd.DataFrame:
    """Returns the runs that came to an end, without those that raised an error."""
    return results[results["cause"] != FAILED]


def figure_table(
    plan: SweepPlan, results: pd.DataFrame
) -> tuple[list[str], list[list[str]]]:
    """Makes a table of the estimates of a parameter sweep, with confidence intervals.

    The table has one row for each cell of the grid. A cell is one combination of the
    values in the grid.

    Args:
        plan: Plan of the sweep.
        results: Results of the sweep, from ``load_results``.

    Returns:
        A pair of lists. The first contains the titles of the quantities. The second
        contains one row for each cell: its name and its estimates as text.
    """
    figured = quantities(results)
    rows = [
        [cell_label(fields), *(shown(q, q.estimate(ended(runs))) for q in figured)]
        for fields, runs in zip(plan.cells(), by_cell(plan, results), strict=True)
    ]
    return [quantity.title for quantity in figured], rows


def by_cell(plan: SweepPlan, results: pd.DataFrame) -> list[pd.DataFrame]:
    """Splits the runs of a parameter sweep by the cells of its grid.

    A cell is one combination of the values in the grid.

    Args:
        plan: Plan of the sweep.
        results: Results of the sweep, from ``load_results``.

    Returns:
        Table of the runs of each cell, in the order of ``plan.cells()``.
    """
    return [results[results["cell"] == k] for k in range(len(plan.cells()))]


@dataclass(frozen=True)
class Marginal:
    """Estimates of a quantity as a function of one drawn field."""

    path: str
    places: NDArray[np.float64]
    """Median of the field in each bin; for choices, their indices from 0."""
    labels: tuple[str, ...]
    """Names of the choices; empty if the field is a number."""
    estimates: tuple[Estimate, ...]
    """Estimate of the quantity in each bin, with its confidence interval."""


def marginal(
    plan: SweepPlan, key: str, runs: pd.DataFrame, quantity: Quantity
) -> Marginal:
    """Estimates a quantity as a function of one randomly drawn field.

    The runs are sorted into bins by the value of the field. If the field is a number,
    the bins have about the same number of runs. Otherwise, each possible value has a
    bin.

    Args:
        plan: Plan of the parameter sweep.
        key: Key of ``plan.draw``. If the key lists several paths, the first path
            represents all of them.
        runs: Runs that came to an end; see ``ended``.
        quantity: Quantity to estimate.

    Returns:
        One estimate for each bin.
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


def shown(quantity: Quantity, estimate: Estimate) -> str:
    """Writes an estimate with its confidence interval for readers.

    Args:
        quantity: Quantity that was estimated: a rate or a median.
        estimate: Value and both ends of its interval, in the unit of the quantity.

    Returns:
        Text. Rates are in percent. Other values have three decimals. A missing value is
        a dash.
    """
    if math.isnan(estimate.value):
        return "-"
    scale, form = (100.0, ".0f") if quantity.rate else (1.0, ".3f")
    value, low, high = (format(scale * x, form) for x in estimate)
    unit = " %" if quantity.rate else ""
    return f"{value}{unit} ({low} to {high})"


def cell_label(fields: dict[str, Any]) -> str:
    """Describes a cell of a grid, which is one combination of values, in a short text.

    Args:
        fields: Values of the grid's fields in this cell, by dotted path.

    Returns:
        Last part of each path with its value, or ``all runs`` if there are no fields.
    """
    pairs = [f"{path.rpartition('.')[2]} {short(v)}" for path, v in fields.items()]
    return ", ".join(pairs) or "all runs"


def short(value: Any, most: int = 24) -> str:
    """Writes a value as short text.

    Args:
        value: Plain value. Values other than texts are written as JSON.
        most: Greatest length of the result, at least 4 characters.

    Returns:
        The text. If the text is too long, three dots replace its end.
    """
    text = value if isinstance(value, str) else json.dumps(value)
    return text if len(text) <= most else f"{text[: most - 3]}..."
