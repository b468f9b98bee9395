"""Runs of several laws on the same random layouts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from analysis.comparison.laws_in_pairs import (
    Comparison,
    Pair,
    compare_runs,
    pooled_pairs,
)
from analysis.reporting.file_names import distinct_names
from analysis.reporting.result_directory import ResultDirectory, take_directory
from analysis.sweeps.one_run import require_runs
from analysis.sweeps.options import check_options
from analysis.sweeps.plan import SweepPlan
from analysis.sweeps.sweep import PreparedSweep, prepare_sweep

#: Names in the directory of a comparison. The directory also contains a folder and a
#: picture for each scenario.
SUMMARY, REPORT, RATES, EXAMPLES = (
    "summary.json",
    "report.html",
    "rates.png",
    "examples",
)
#: Ending of a scenario's picture. The rest of its name is the name of the folder.
PICTURE = ".png"


@dataclass(frozen=True)
class PreparedComparison:
    """A comparison that is ready to run; see ``prepare_comparison``."""

    out: Path
    sweeps: dict[str, PreparedSweep]
    """Sweep of each scenario, by the scenario's name. The folder of a sweep has the
    same name if the file system allows it."""

    @property
    def runs(self) -> int:
        """Total number of runs, over all scenarios and laws."""
        return sum(len(sweep.points) for sweep in self.sweeps.values())

    @property
    def done(self) -> int:
        """Number of runs that are already done."""
        return sum(len(sweep.store.done) for sweep in self.sweeps.values())

    def run(
        self, progress: Callable[[int], None] | None = None
    ) -> tuple[dict[str, Comparison], list[Pair]]:
        """Does the runs, and summarizes the results of each scenario.

        Args:
            progress: Function that is called a few times per second with the number of
                finished runs.

        Returns:
            A pair of results. The first is a mapping from each scenario's name to its
            comparison. The second is a list of pairs of control laws, each compared
            over all scenarios together.

        Raises:
            RunError: Every run failed.
        """
        tables: list[tuple[SweepPlan, Any]] = []
        before = 0

        def report(before: int, done: int) -> None:
            if progress is not None:
                progress(before + done)

        for sweep in self.sweeps.values():
            tables.append((sweep.plan, sweep.run(partial(report, before))))
            before += len(sweep.points)
        require_runs([table for _, table in tables], self.out)
        comparisons = {
            name: compare_runs(plan, table, name)
            for name, (plan, table) in zip(self.sweeps, tables, strict=True)
        }
        return comparisons, pooled_pairs(tables)


def prepare_comparison(
    plans: dict[str, SweepPlan],
    out: str | Path | None = None,
    *,
    workers: int | None = None,
    resume: bool = False,
) -> PreparedComparison:
    """Draws all layouts of a comparison, checks them, and opens the result directories.

    A layout is one random variant of the positions and motions of all bodies.

    Args:
        plans: Plan of each scenario, by the scenario's name; see ``comparison_plan``.
        out: Directory of the comparison. None means the next number under results/.
        workers: Number of processes. None means one process per processor core.
        resume: Whether ``out`` may contain runs of the same comparison. These runs are
            kept.

    Returns:
        The comparison, which can be run once. Its directories are locked until then.

    Raises:
        InputError: An argument or a plan is not valid. The message states the fault and
            the remedy.
    """
    check_options(out, workers=workers, resume=resume)
    directory = Path(out).expanduser() if out is not None else None
    taken: ResultDirectory | None = None
    if directory is None or not (resume and directory.exists()):
        taken = take_directory(out)
        directory = directory or Path("results") / taken.path.name
    sweeps: dict[str, PreparedSweep] = {}
    ours = (SUMMARY, REPORT, RATES, EXAMPLES)
    folders = distinct_names(plans, taken=ours, endings=("", PICTURE))
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
        taken.close()  # from now on the directories of the runs are locked
    return PreparedComparison(directory, sweeps)
