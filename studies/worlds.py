"""Success, collisions, time-outs, times and scores in worlds of cylinders.

By default, the worlds are the 12 that come with phonotaxis. Each law drives in each
world at each top speed, with other noise in each run. The rules are those of the BARN
challenge (docs/worlds.md).
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator
from pathlib import Path

from analysis.batches.cells import Cell
from analysis.batches.comparison_plans import WORLD_SCENARIO, comparison_plan
from analysis.report.intervals import Estimate
from diagrams.scenario.worlds.catalog import chosen_worlds
from phonotaxis.batches import prepare_compare
from phonotaxis.result import ignore
from studies.tables import Table

SEED = 1
COLUMNS = (
    "law",
    "top speed",
    "runs",
    "success (%)",
    "collisions (%)",
    "time-outs (%)",
    "mean time (s)",
    "score",
    "score of earlier editions",
)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Options of the study."""
    parser.add_argument("--worlds", metavar="PATH", default="shipped")
    parser.add_argument("--every", metavar="N", type=int, default=1)
    parser.add_argument("--runs", metavar="N", type=int, default=1)
    parser.add_argument("--laws", metavar="LAW,...", default="guarded,vfh_plus")
    parser.add_argument("--speeds", metavar="M_S,...", default="0.5")
    parser.add_argument("--workers", metavar="N", type=int)


def run(options: argparse.Namespace) -> Iterator[Table]:
    """The figures of each law at each top speed, with 95 % intervals."""
    yield Table("figures", COLUMNS, _rows(options))


def _rows(options: argparse.Namespace) -> Iterator[list[str]]:
    worlds = chosen_worlds(options.worlds, options.every)
    for speed in map(float, options.speeds.split(",")):
        plan = comparison_plan(
            WORLD_SCENARIO,
            laws=options.laws,
            runs=options.runs,
            seed=SEED,
            settings={"robot.top_speed_m_s": speed},
            worlds=worlds,
        )
        with tempfile.TemporaryDirectory() as folder:
            prepared = prepare_compare(
                {WORLD_SCENARIO: plan}, Path(folder) / "out", workers=options.workers
            )
            (summary,) = prepared.run(ignore).scenarios.values()
        for cell in summary.cells:
            yield [f"`{cell.fields['law']}`", f"{speed:g} m/s", *_figures(cell)]


def _figures(cell: Cell) -> list[str]:
    found = cell.metrics
    return [
        str(cell.runs),
        cell.success.text(".0f", factor=100.0),
        cell.collision.text(".0f", factor=100.0),
        f"{100.0 * found['timeout_fraction'].value:.0f}",
        _text(found.get("mean_time_s"), ".1f"),
        _text(found.get("score"), ".3f"),
        _text(found.get("score_4"), ".3f"),
    ]


def _text(estimate: Estimate | None, spec: str) -> str:
    return "-" if estimate is None else estimate.text(spec)
