"""Reads endings, metrics and warnings from a sweep's table of runs."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import dataclass
from zlib import crc32

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.runs.metric_table import Metric
from diagrams.running.stop_rules import SUCCESSFUL


def successes(rows: pd.DataFrame) -> NDArray[np.bool_]:
    """(n,) whether each run was successful."""
    return rows["cause"].isin(SUCCESSFUL).to_numpy()


def collisions(rows: pd.DataFrame) -> NDArray[np.bool_]:
    """(n,) whether each run ended in a collision."""
    return (rows["cause"] == "collision").to_numpy()


def counted(rows: pd.DataFrame, metric: Metric) -> NDArray[np.bool_]:
    """(n,) whether an average of the metric includes each run."""
    if metric.of == "successes":
        return successes(rows)
    return np.ones(len(rows), dtype=bool)


def column(rows: pd.DataFrame, name: str) -> NDArray[np.float64]:
    """Returns one metric of each run.

    Args:
        rows: Table of n runs.
        name: Name of the metric's column. The table may lack this column.

    Returns:
        (n,) values in the unit of the metric. The value is NaN for a run without this
        metric.
    """
    if name not in rows:
        return np.full(len(rows), np.nan)
    return rows[name].to_numpy(dtype=float)


def bootstrap_seed(seed: int, name: str) -> int:
    """Returns the random seed for the bootstrap of a metric.

    Args:
        seed: Seed of the sweep.
        name: Name of the metric.

    Returns:
        Seed of 32 bits. Each metric has its own seed, so that the samples of the
        metrics are independent.
    """
    return crc32(json.dumps([seed, name]).encode())


@dataclass(frozen=True)
class WarningCount:
    """A warning about a field of the scenario, with the number of affected runs."""

    field: str
    runs: int
    message: str
    """Message of the first run with this warning."""


def warning_counts(rows: pd.DataFrame) -> list[WarningCount]:
    """Counts the warnings of many runs, for each field of the scenario.

    Args:
        rows: Table of runs. The column ``warnings`` contains JSON in the format of
            ``summary.json``. The table may lack this column.

    Returns:
        Counts, the most frequent warning first. The list is empty if there are no
        warnings.
    """
    runs, messages = Counter[str](), dict[str, str]()
    for text in rows.get("warnings", ()):
        told = json.loads(text)
        runs.update({each["field"] for each in told})
        for each in told:
            messages.setdefault(each["field"], each["message"])
    # Equal counts keep the order of the messages, because the order of a set is random.
    fields = sorted(messages, key=lambda field: -runs[field])
    return [WarningCount(name, runs[name], messages[name]) for name in fields]
