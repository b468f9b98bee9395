"""Reads endings, metrics and warnings from a sweep's table of runs."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.runs.metric_table import METRICS
from diagrams.running.stop_rules import SUCCESSFUL

_OF_ROBOTS: dict[str, Any] = {"mean": np.mean, "least": np.min, "greatest": np.max}


def successes(rows: pd.DataFrame) -> NDArray[np.bool_]:
    """(n,) whether each run was successful."""
    return rows["cause"].isin(SUCCESSFUL).to_numpy()


def collisions(rows: pd.DataFrame) -> NDArray[np.bool_]:
    """(n,) whether each run ended in a collision."""
    return (rows["cause"] == "collision").to_numpy()


def column(rows: pd.DataFrame, name: str) -> NDArray[np.float64]:
    """(n,) one metric of each run; NaN for a run without this metric."""
    if name not in rows:
        return np.full(len(rows), np.nan)
    return rows[name].to_numpy(dtype=float)


def with_all_robots(table: pd.DataFrame, robots: Sequence[str]) -> pd.DataFrame:
    """Adds metrics over all robots to the table of a parameter sweep.

    ``Metric.robots`` states how the values of several robots become one value of their
    run. If one robot has no value of a metric in a run, the value for all robots is
    NaN. If there is only one robot, the table is returned as it is.
    """
    if len(robots) < 2:
        return table
    pooled = {}
    for name, metric in METRICS.items():
        columns = [f"{robot}.{name}" for robot in robots]
        if all(each in table for each in columns):
            values = [column(table, each) for each in columns]
            pooled[name] = _OF_ROBOTS[metric.robots](values, axis=0)
    return table.assign(**pooled)


@dataclass(frozen=True)
class WarningCount:
    """A warning about a field of the scenario, with the number of affected runs."""

    field: str
    runs: int
    message: str
    """Message of the first run with this warning."""


def warning_counts(rows: pd.DataFrame) -> list[WarningCount]:
    """Counts the runs with a warning, for each field; the most frequent field first.

    The column ``warnings`` contains JSON text: lists of mappings with the keys
    ``field`` and ``message``. If the column is missing, the result is empty.
    """
    runs, messages = Counter[str](), dict[str, str]()
    for text in rows.get("warnings", ()):
        told = json.loads(text)
        runs.update({each["field"] for each in told})
        for each in told:
            messages.setdefault(each["field"], each["message"])
    # Fields with equal counts keep the order of ``messages``. A set has random order.
    fields = sorted(messages, key=lambda field: -runs[field])
    return [WarningCount(name, runs[name], messages[name]) for name in fields]
