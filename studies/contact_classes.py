"""How the contacts of a comparison came about.

``python -m studies contact_classes results/NUMBER`` runs each run of a directory of
``phonotaxis compare`` that ended in a collision once more, and prints the table of
docs/results_laws.md: whose fault it was, when a cone last had an echo of the body, and
where on the robot it was touched.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd

from analysis.batches.plan import SweepPlan, load_sweep
from analysis.batches.store import load_results
from diagrams import simulate
from studies.tables import Table
from systems.world.geometry import nearest_point_on_rectangle, rotate

#: Ends of the classes of when a body was last seen, s before the contact.
_LAST_SEEN_S = {"to the end": 0.1, "up to 1 s before": 1.0, "1 to 4 s before": 4.0}
_HEAD = ("scenario", "law", "layouts", "contacts", "robot's fault")
_PLACES = ("ahead of the axle", "behind it")


def contact_table(results: Path) -> Table:
    """Numbers of contacts by class.

    Args:
        results: Directory of a comparison, a folder a scenario in it.

    Returns:
        A row a scenario and law in which something was touched.
    """
    seen = [*(f"seen {name}" for name in _LAST_SEEN_S), "longer ago", "never seen"]
    rows = []
    for folder in sorted(path.parent for path in results.glob("*/runs.parquet")):
        table, plan = load_results(folder), load_sweep(folder / "sweep.yaml")
        for law, runs in table.groupby("law", sort=False, observed=True):
            hits = runs[runs["cause"] == "collision"]
            if hits.empty:
                continue
            by_robot = int((hits["collision_fault"] == "robot").sum())
            counts = [len(runs), len(hits), by_robot]
            counts += [*_last_seen(hits), *_touched(hits, plan)]
            rows.append([folder.name, str(law), *map(str, counts)])
    return Table("contacts", [*_HEAD, *seen, *_PLACES], rows)


def _last_seen(hits: pd.DataFrame) -> list[int]:
    """How many bodies were last seen when; of the last class, never."""
    unseen = hits["contact_unseen_s"].to_numpy(dtype=float)
    edges = [-np.inf, *_LAST_SEEN_S.values(), np.inf]
    counts = np.histogram(unseen[np.isfinite(unseen)], edges)[0]
    return [*counts.tolist(), int(np.isnan(unseen).sum())]


def _touched(hits: pd.DataFrame, plan: SweepPlan) -> tuple[int, int]:
    """How many bodies touched the robot ahead of its axle, and behind."""
    points, ahead = plan.points(), 0
    for index in hits["index"]:
        run = simulate(plan.scenario_of(points[index]), engine="compiled")
        assert run.collision is not None, f"run {index} touches nothing any more"
        body = run.surroundings.bodies[run.collision.object]
        x, y, theta = run.poses("WB")[-1]
        dx, dy = nearest_point_on_rectangle((x, y), body.rectangles(run.time[-1])[0])
        ahead += rotate(-theta, dx, dy)[0] > 0.0
    return ahead, len(hits) - ahead


def add_options(parser: argparse.ArgumentParser) -> None:
    """Options of the study."""
    parser.add_argument("results", type=Path, help="directory of phonotaxis compare")


def run(options: argparse.Namespace) -> Iterator[Table]:
    """The table."""
    yield contact_table(options.results)
