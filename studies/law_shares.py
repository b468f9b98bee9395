"""How often each law arrived, collided and followed.

``python -m studies law_shares results/NUMBER`` prints, of a directory of
``phonotaxis compare``, the tables of docs/results_laws.md and docs/guard.md.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import pandas as pd

from analysis.batches.store import load_results
from analysis.report.intervals import estimate_rate
from diagrams.running.stop_rules import SUCCESSFUL
from studies.tables import Table

_HEAD = (
    "scenario",
    "law",
    "layouts",
    "success",
    "collisions",
    "robot's fault",
    "time to the goal",
    "in the band",
)


def shares_table(results: Path) -> Table:
    """Shares of all layouts, with 95 % intervals.

    Args:
        results: Directory of a comparison, a folder a scenario in it.

    Returns:
        A row a scenario and law. The time is the median of the first entry into the
        goal, of runs that succeed; in the band is the mean share of the time, of all
        runs, in which the robot followed.
    """
    rows = []
    for folder in sorted(path.parent for path in results.glob("*/runs.parquet")):
        table = load_results(folder)
        for law, runs in table.groupby("law", sort=False, observed=True):
            rows.append([folder.name, str(law), *_row(runs)])
    return Table("shares", _HEAD, rows)


def _row(runs: pd.DataFrame) -> list[str]:
    count, cause = len(runs), runs["cause"].astype("object")
    good, hits = cause.isin(SUCCESSFUL), cause == "collision"
    by_robot = hits & (runs["collision_fault"].astype("object") == "robot")
    times = runs.loc[good & (cause == "reached"), "time_to_goal_s"]
    shares = (_share(int(each.sum()), count) for each in (good, hits, by_robot))
    time = "" if times.empty else f"{times.median():.1f} s"
    return [str(count), *shares, time, f"{runs['following_fraction'].mean():.2f}"]


def _share(part: int, count: int) -> str:
    return estimate_rate(part, count).text(".1f", unit=" %", factor=100.0)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Options of the study."""
    parser.add_argument("results", type=Path, help="directory of phonotaxis compare")


def run(options: argparse.Namespace) -> Iterator[Table]:
    """The table."""
    yield shares_table(options.results)
