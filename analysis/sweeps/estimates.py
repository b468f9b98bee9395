"""What the runs of a sweep say, with intervals: by cell, and by drawn field."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.reporting.intervals import Estimate, median_interval, wilson_interval
from analysis.sweeps.one_run import FAILED
from analysis.sweeps.plan import SweepPlan
from diagrams.running.stop_rules import SUCCESSFUL

#: A drawn number is cut into at most so many bins, of so many runs or more.
MOST_BINS, LEAST_RUNS = 8, 20


@dataclass(frozen=True)
class Quantity:
    """Something to estimate from runs."""

    name: str
    """Key in documents."""
    title: str
    """Words for pictures, with the unit."""
    causes: tuple[str, ...] = ()
    """The share of runs that end so; none: the median of a metric."""
    metric: str = ""
    """Column of the results."""

    @property
    def rate(self) -> bool:
        """Whether it is a share, between 0 and 1."""
        return bool(self.causes)

    def estimate(self, runs: pd.DataFrame) -> Estimate:
        """The figure for runs that ended; see ``ended``."""
        nothing = Estimate(np.nan, np.nan, np.nan)
        if self.rate:
            count = int(runs["cause"].isin(self.causes).sum())
            if runs.empty:
                return nothing
            return Estimate(count / len(runs), *wilson_interval(count, len(runs)))
        if self.metric not in runs:
            return nothing
        values = runs[self.metric].dropna().to_numpy()
        if not len(values):
            return nothing
        return Estimate(float(np.median(values)), *median_interval(values))


#: What pages and pictures show of one robot; see ``quantities``.
QUANTITIES = (
    Quantity("success", "runs that end well", causes=SUCCESSFUL),
    Quantity("collision", "runs that end in a collision", causes=("collision",)),
    Quantity(
        "minimum_clearance_m",
        "least clearance, median (m)",
        metric="minimum_clearance_m",
    ),
    Quantity(
        "following_error_rms_m",
        "following error rms, median (m)",
        metric="following_error_rms_m",
    ),
)


def quantities(results: pd.DataFrame) -> tuple[Quantity, ...]:
    """What pages and pictures show: of several robots, each one's own figures."""
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
    return tuple(shown_)


def ended(results: pd.DataFrame) -> pd.DataFrame:
    """The runs that came to an end, whichever: not those that raised an error."""
    return results[results["cause"] != FAILED]


def figure_table(
    plan: SweepPlan, results: pd.DataFrame
) -> tuple[list[str], list[list[str]]]:
    """What pages show of each cell, with intervals.

    Args:
        plan: What was run.
        results: See ``load_results``.

    Returns:
        Titles of the quantities, and for each cell its name and figures.
    """
    figured = quantities(results)
    rows = [
        [cell_label(fields), *(shown(q, q.estimate(ended(runs))) for q in figured)]
        for fields, runs in zip(plan.cells(), by_cell(plan, results), strict=True)
    ]
    return [quantity.title for quantity in figured], rows


def by_cell(plan: SweepPlan, results: pd.DataFrame) -> list[pd.DataFrame]:
    """The runs of each cell of the grid.

    Args:
        plan: What was run.
        results: See ``load_results``.

    Returns:
        A table for each of ``plan.cells()``.
    """
    return [results[results["cell"] == k] for k in range(len(plan.cells()))]


@dataclass(frozen=True)
class Marginal:
    """A quantity against one drawn field, whatever the others were."""

    path: str
    places: NDArray[np.float64]
    """Median of the field in each bin, or the number of each choice."""
    labels: tuple[str, ...]
    """Names of the choices; none for numbers."""
    estimates: tuple[Estimate, ...]
    """One a bin."""


def marginal(
    plan: SweepPlan, key: str, runs: pd.DataFrame, quantity: Quantity
) -> Marginal:
    """Estimates for bins of a drawn field.

    Args:
        plan: The sweep.
        key: Of ``plan.draw``; of several paths the first one stands for all.
        runs: That ended.
        quantity: What is estimated.

    Returns:
        Bins hold about the same number of runs each, or one choice each.
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
    """An estimate with its interval, for readers; a dash where there is none.

    Args:
        quantity: Says whether it is a rate.
        estimate: Value and both ends of its interval, in the quantity's unit.

    Returns:
        Rates in %, others with three significant digits.
    """
    if math.isnan(estimate.value):
        return "-"
    scale, form = (100.0, ".0f") if quantity.rate else (1.0, ".3f")
    value, low, high = (format(scale * x, form) for x in estimate)
    unit = " %" if quantity.rate else ""
    return f"{value}{unit} ({low} to {high})"


def cell_label(fields: dict[str, Any]) -> str:
    """Fields of a cell in words: last part of each path, and value.

    Args:
        fields: Values of the grid by path.

    Returns:
        ``all runs`` where there is nothing to show.
    """
    pairs = [f"{path.rpartition('.')[2]} {short(v)}" for path, v in fields.items()]
    return ", ".join(pairs) or "all runs"


def short(value: Any, most: int = 24) -> str:
    """A value in few letters.

    Args:
        value: Plain value; what is not text is written as JSON.
        most: Letters, at least 4.

    Returns:
        At most so many letters; of longer ones the end is left out.
    """
    text = value if isinstance(value, str) else json.dumps(value)
    return text if len(text) <= most else f"{text[: most - 3]}..."
