"""What several robots did together: one figure of each kind a run."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from analysis.runs.run_table import ALL_RUNS, SUCCESSES, column

#: Of times that of the robot that took longest counts.
_LAST = ("time_to_goal_s",)
#: Of minima and maxima the worst robot's.
_WORST = ("minimum_", "least_"), ("_max_", "greatest_")


def with_all_robots(table: pd.DataFrame, robots: Sequence[str]) -> pd.DataFrame:
    """A sweep's results with figures of all robots together beside each one's own.

    Least distances and times to contact are those of the robot that had the least,
    greatest ones of that with the greatest, and a time to the goal is that of the last
    one there; of everything else it is the mean over robots. A run in which a robot
    lacks a figure has none.

    Args:
        table: See ``analysis.sweeps.store.load_results``.
            robots: Names of the robots. The table has the figures of an only robot already.

    Returns:
        The table, or one with more columns.
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
