"""Batches: sweeps, and comparisons of control laws.

A sweep runs many variants of one scenario. A comparison consists of one sweep per
scenario, in which every law meets the same random layouts.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import pandas as pd

from analysis.batches.cells import Cell, by_cell, make_cell
from analysis.batches.one_run import require_runs
from analysis.batches.options import check_options
from analysis.batches.pairs import Pair, pairs_of, pooled_pairs
from analysis.batches.plan import SweepPlan
from analysis.batches.run_rows import with_all_robots
from analysis.batches.sweep import PreparedSweep, prepare_sweep
from analysis.report.file_names import distinct_names
from analysis.report.result_directory import ResultDirectory, take_directory
from diagrams.scenario.scenario import scenario_from_mapping

#: Names of two files and a folder in the directory of a batch. The directory of a
#: comparison also contains a folder for each scenario.
SUMMARY, REPORT, EXAMPLES = "summary.json", "report.html", "examples"
#: Greatest number of cells for which a report compares pairs and shows example runs. A
#: cell is one combination of the values in the grid of a sweep.
MOST_CELLS = 24


@dataclass(frozen=True)
class Summary:
    """The runs of one scenario, and their evaluation."""

    name: str
    plan: SweepPlan
    rows: pd.DataFrame
    """Table with one row per run. If there are several robots, the table also contains
    the metrics over all robots."""
    cells: list[Cell]
    pairs: list[Pair]
    """Comparisons of two cells each; empty if the sweep does not compare laws."""

    @property
    def robots(self) -> list[str]:
        """Names of the robots; empty if there is only one robot."""
        endings = [name for name in self.rows.columns if name.endswith(".cause")]
        return [name.removesuffix(".cause") for name in endings]


def compares_laws(plan: SweepPlan) -> bool:
    """Returns whether a sweep of at most 24 cells compares laws on the same layouts."""
    return plan.pair and "law" in plan.grid and plan.cell_count <= MOST_CELLS


def summarize(plan: SweepPlan, table: pd.DataFrame, name: str) -> Summary:
    """Summarizes the runs of a sweep.

    Args:
        plan: Plan of the sweep.
        table: Table of the runs, from ``load_results``.
        name: Name of the scenario.

    Returns:
        The runs, with an evaluation of each cell and of each pair of cells.
    """
    scenario = scenario_from_mapping(plan.base)
    if "tick_s" not in table:  # otherwise, the sweep varies it
        table = table.assign(tick_s=scenario.tick_s)
    rows = with_all_robots(table, list(scenario.robots)).sort_values("index")
    cells = [
        make_cell(name, fields, runs, plan.seed)
        for fields, runs in zip(plan.cells(), by_cell(plan, rows), strict=True)
    ]
    pairs = pairs_of(plan, rows, name) if compares_laws(plan) else []
    return Summary(name, plan, rows, cells, pairs)


@dataclass(frozen=True)
class Batch:
    """Results of a batch."""

    title: str
    out: Path
    sweeps: dict[str, PreparedSweep]
    """Sweep of each scenario, by the scenario's name."""
    summaries: dict[str, Summary]
    """Results of each scenario, by the scenario's name."""
    pooled: list[Pair]
    """Comparisons of two values of a field, for example of two laws. Each comparison
    includes the runs of all scenarios, with all values of the other fields."""

    def require_runs(self) -> None:
        """Raises RunError if every run failed."""
        require_runs([each.rows for each in self.summaries.values()], self.out)


@dataclass(frozen=True)
class PreparedBatch:
    """A batch that is ready to run once."""

    title: str
    out: Path
    sweeps: dict[str, PreparedSweep]
    """Sweep of each scenario, by the scenario's name. In a comparison, each sweep has a
    folder with this name, changed only if the file system requires it."""

    @property
    def runs(self) -> int:
        """Total number of runs, over all scenarios and cells."""
        return sum(len(sweep.points) for sweep in self.sweeps.values())

    @property
    def done(self) -> int:
        """Number of runs that are already done."""
        return sum(len(sweep.store.done) for sweep in self.sweeps.values())

    def run(self, progress: Callable[[int], None] | None = None) -> Batch:
        """Does the runs that are not done yet, and summarizes each scenario.

        The function ``progress`` is called with the number of finished runs, over all
        scenarios. For the errors, see ``PreparedSweep.run``.
        """
        summaries: dict[str, Summary] = {}
        before = 0

        def report(before: int, done: int) -> None:
            if progress is not None:
                progress(before + done)

        for name, sweep in self.sweeps.items():
            table = sweep.run(partial(report, before))
            summaries[name] = summarize(sweep.plan, table, name)
            before += len(sweep.points)
        pooled = pooled_pairs(
            [(each.plan, each.rows) for each in summaries.values() if each.pairs]
        )
        return Batch(self.title, self.out, self.sweeps, summaries, pooled)


def prepare_batch(
    plan: SweepPlan,
    out: str | Path | None = None,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    resume: bool = False,
) -> PreparedBatch:
    """Prepares a batch of one sweep; see ``prepare_sweep``."""
    sweep = prepare_sweep(
        plan, out, workers=workers, scheduler=scheduler, resume=resume
    )
    title = f"Sweep {plan.name}: {plan.scenario}"
    return PreparedBatch(title, sweep.store.out, {Path(plan.scenario).stem: sweep})


def prepare_comparison(
    plans: Mapping[str, SweepPlan],
    out: str | Path | None = None,
    *,
    workers: int | None = None,
    resume: bool = False,
) -> PreparedBatch:
    """Draws and checks all layouts of a comparison, and opens its directories.

    A layout is one random variant of the positions and motions of all bodies. The
    argument ``plans`` maps the name of each scenario to its plan, which
    ``comparison_plan`` makes. For the other arguments, see ``prepare_sweep``.
    """
    check_options(out, workers=workers, resume=resume)
    directory = Path(out).expanduser() if out is not None else None
    taken: ResultDirectory | None = None
    if directory is None or not (resume and directory.exists()):
        taken = take_directory(out)
        directory = directory or Path("results") / taken.path.name
    sweeps: dict[str, PreparedSweep] = {}
    folders = distinct_names(plans, taken=(SUMMARY, REPORT, EXAMPLES))
    try:
        for (name, plan), folder in zip(plans.items(), folders, strict=True):
            sweeps[name] = prepare_sweep(
                plan, directory / folder, workers=workers, resume=resume
            )
    except BaseException:
        for sweep in sweeps.values():
            sweep.store.close()
        if taken is not None:
            taken.undo(contents=True)
        raise
    if taken is not None:
        taken.close()  # from now on, each sweep locks its own directory
    title = f"Comparison of laws: {', '.join(plans)}"
    return PreparedBatch(title, directory, sweeps)
