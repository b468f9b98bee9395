"""Metrics of several robots together: one value of each metric per run."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from analysis.runs.run_table import ALL_RUNS, SUCCESSES, column

#: Metrics for which the largest value of any robot counts: the last arrival.
_LAST = ("time_to_goal_s",)
#: Metrics for which the worst robot counts. The first part lists beginnings of the
#: names of minima. The second part lists pieces of the names of maxima.
_WORST = ("minimum_", "least_"), ("_max_", "greatest_")


def with_all_robots(table: pd.DataFrame, robots: Sequence[str]) -> pd.DataFrame:
    """Adds the metrics of all robots together to the results of a parameter sweep.

    The results have one row per run. If there are several robots, the results have
    separate columns for each robot. The value for all robots depends on the metric:

    - Least distances and least times to contact: the smallest value of any robot.
    - Greatest values: the largest value of any robot.
    - Time to the goal: the time of the robot that arrives last.
    - Every other metric: the mean over the robots.

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
    for name in (*ALL_RUNS, *SUCCESSES):
        each = np.stack([column(table, f"{robot}.{name}") for robot in robots])
        if name.startswith(_WORST[0]):
            pooled[name] = np.min(each, axis=0)
        elif name in _LAST or any(part in name for part in _WORST[1]):
            pooled[name] = np.max(each, axis=0)
        else:
            pooled[name] = np.mean(each, axis=0)
    return table.assign(**pooled)
