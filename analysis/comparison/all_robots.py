"""Metrics of several robots together: one value of each metric per run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from analysis.runs.metric_table import METRICS
from analysis.runs.run_table import column

_OF_ROBOTS: dict[str, Any] = {"mean": np.mean, "least": np.min, "greatest": np.max}


def with_all_robots(table: pd.DataFrame, robots: Sequence[str]) -> pd.DataFrame:
    """Adds the metrics of all robots together to the results of a parameter sweep.

    The results have one row per run. If there are several robots, the results have
    separate columns for each robot. ``Metric.robots`` states how the values of all
    robots become one value.

    If one robot has no value of a metric in a run, the value for all robots is NaN.

    Args:
        table: Results of the sweep, from ``analysis.sweeps.store.load_results``.
        robots: Names of the robots. With one robot, the table already has the metrics.

    Returns:
        The table with the added columns. With one robot, the table is unchanged.
    """
    if len(robots) < 2:
        return table
    pooled = {}
    for name, metric in METRICS.items():
        each = np.stack([column(table, f"{robot}.{name}") for robot in robots])
        pooled[name] = _OF_ROBOTS[metric.robots](each, axis=0)
    return table.assign(**pooled)
