"""Columns of a sweep's table, and which runs they are of."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import dataclass
from zlib import crc32

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from diagrams.running.stop_rules import SUCCESSFUL

#: Figures that any run has, however it ended.
ALL_RUNS = (
    "minimum_clearance_m",
    "minimum_obstacle_clearance_m",
    "minimum_time_to_contact_s",
    "reaction_distance_m",
    "yaw_ripple_rad_s",
    "route_deviation_m",
    "route_deviation_max_m",
    "replans",
    "greatest_stiffness_n_m",
    "last_stiffness_n_m",
)
#: Figures that a collision or a jam would cut short: of successful runs alone.
SUCCESSES = (
    "time_to_goal_s",
    "path_length_m",
    "following_fraction",
    "following_error_rms_m",
    "following_error_p95_m",
    "jerk_rms_m_s3",
    "jerk_max_m_s3",
    "angular_jerk_rms_rad_s3",
    "sparc",
    "ldlj",
    "turn_reversals_per_s",
    "heading_change_rad_m",
    "control_effort_rms_n",
    "wheel_variation_m_s2",
    "saturated_fraction",
    "odometry_error_rms_m",
    "odometry_error_final_m",
    "odometry_heading_error_rms_deg",
    "slip_way_m",
)


def successes(rows: pd.DataFrame) -> NDArray[np.bool_]:
    """(n,) whether each run did what it should."""
    return rows["cause"].isin(SUCCESSFUL).to_numpy()


def collisions(rows: pd.DataFrame) -> NDArray[np.bool_]:
    """(n,) whether each run ended in a collision."""
    return (rows["cause"] == "collision").to_numpy()


def column(rows: pd.DataFrame, name: str) -> NDArray[np.float64]:
    """A figure of each run; NaN where it has none.

    Args:
        rows: n runs.
        name: Of the column; there may be none of that name.

    Returns:
        (n,) in the figure's unit.
    """
    if name not in rows:
        return np.full(len(rows), np.nan)
    return rows[name].to_numpy(dtype=float)


def bootstrap_seed(seed: int, name: str) -> int:
    """Seed of the bootstrap of a figure.

    Args:
        seed: Of the sweep.
        name: Of the figure.

    Returns:
        32 bits: figures are resampled independently of each other.
    """
    return crc32(json.dumps([seed, name]).encode())


@dataclass(frozen=True)
class WarningCount:
    """In how many runs a field of the scenario was warned about."""

    field: str
    runs: int
    message: str
    """Of the first of these runs."""


def warning_counts(rows: pd.DataFrame) -> list[WarningCount]:
    """The warnings of many runs, field by field.

    Args:
        rows: Runs; their column ``warnings`` is JSON, as ``summary.json`` has it. There
            may be none of that name.

    Returns:
        The commonest first; empty where there are no warnings.
    """
    runs, messages = Counter[str](), dict[str, str]()
    for text in rows.get("warnings", ()):
        told = json.loads(text)
        runs.update({each["field"] for each in told})
        for each in told:
            messages.setdefault(each["field"], each["message"])
    # In the order of the messages, so that no order of a set shows.
    fields = sorted(messages, key=lambda field: -runs[field])
    return [WarningCount(name, runs[name], messages[name]) for name in fields]
