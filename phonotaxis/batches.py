"""Batches of runs: sweeps, and comparisons of laws."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, overload

from analysis.batches.batch import (
    Batch,
    PreparedBatch,
    Summary,
    prepare_batch,
    prepare_comparison,
)
from analysis.batches.comparison_plans import (
    EXPERIMENTS,
    WORLD_SCENARIO,
    comparison_plan,
)
from analysis.batches.figures import batch_figures
from analysis.batches.page import write_batch
from analysis.batches.plan import SweepPlan, load_sweep
from analysis.batches.plots import plot_cells, plot_over
from analysis.batches.report import batch_document, batch_text, warning_lines
from analysis.report.result_directory import whole_directory
from diagrams.scenario.suggestions import Laws
from diagrams.scenario.worlds.catalog import chosen_worlds
from phonotaxis.result import Prepared, Result, ignore
from systems.framework.input_error import InputError

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from analysis.batches.pairs import Pair

__all__ = ["ComparisonResult", "SweepResult", "compare", "sweep"]


@dataclass(frozen=True, repr=False)
class BatchResult(Result):
    """Results of many runs. The directory ``out`` contains their files."""

    batch: Batch

    @property
    def out(self) -> Path:
        """Directory of the results, which contains ``report.html``."""
        return self.batch.out

    def document(self) -> dict[str, Any]:
        """Returns the JSON document of the command ``sweep`` or ``compare``."""
        return batch_document(self.batch)

    def __str__(self) -> str:
        """Tables of the results, for a terminal."""
        return batch_text(self.batch, self.document())

    @property
    def notes(self) -> tuple[str, ...]:
        """One line per warning, with the number of runs that it affects."""
        every = self.batch.summaries.values()
        return tuple(line for each in every for line in warning_lines(each))

    @overload
    def plot(self) -> dict[str, Figure]: ...

    @overload
    def plot(
        self, quantity: str, *, over: str, by: str = "", scenario: str = ""
    ) -> Figure: ...

    def plot(
        self, quantity: str = "", *, over: str = "", by: str = "", scenario: str = ""
    ) -> Figure | dict[str, Figure]:
        """Draws one quantity over a field, or all quantities of all cells.

        Example: ``found.plot("collision", over="source.speed_m_s", by="law")``. The
        method ``savefig`` of the figure writes PDF, SVG and PNG files.

        Args:
            quantity: ``success``, ``collision``, or the name of a metric. Empty means
                all rates and metrics of all cells, in one figure for each scenario.
            over: Field on the horizontal axis: one of the grid, or a drawn field. A
                drawn number is sorted into at least four bins of equal numbers of runs.
            by: Field of the grid with one curve per value. Empty means one curve.
            scenario: Scenario of a comparison. Empty means the first one.

        Returns:
            The figure with 95 % intervals; without a quantity, figures by scenario.

        Raises:
            InputError: The quantity, a field or the scenario is not part of the batch.
        """
        summaries = self.batch.summaries
        if not quantity:
            return {name: plot_cells(x.plan, x.rows) for name, x in summaries.items()}
        chosen = summaries.get(scenario or next(iter(summaries)))
        if chosen is None:
            known = ", ".join(summaries)
            raise InputError("scenario", f"{scenario!r} is not there; use {known}")
        return plot_over(chosen.plan, chosen.rows, quantity, over, by)

    def figures(self) -> dict[str, Figure]:
        """Draws the figures of a paper, by name.

        There is one figure of all cells per scenario. For each number in the grid, and
        for each drawn number, there are figures of the success rate and the collision
        rate.
        """
        return batch_figures(self.batch)

    def write(self, document: dict[str, Any], directory: Path) -> None:
        """Writes the page, the JSON document and the examples into ``out``.

        Args:
            document: The JSON document.
            directory: The directory ``out``.

        Raises:
            RunError: Every run failed.
        """
        write_batch(self.batch, document)
        self.batch.require_runs()

    def save(self, directory: str | Path | None = None) -> Path:
        """Copies the directory ``out``, which already contains all files.

        Args:
            directory: New or empty directory for the copy. None means no copy.

        Returns:
            Path of the copy; without a copy, ``out``.

        Raises:
            InputError: The directory is in use, or cannot be created or written.
        """
        if directory is None:
            return self.out
        with whole_directory(directory) as (shown, partial):
            shutil.copytree(self.out, partial, dirs_exist_ok=True)
        return shown


class SweepResult(BatchResult):
    """Results of a sweep: many runs in one table."""

    @property
    def plan(self) -> SweepPlan:
        """Plan of the sweep."""
        return self._only.plan

    @property
    def table(self) -> pd.DataFrame:
        """Table with one row per run: fields, ending and metrics (docs/compare.md)."""
        return self._only.rows

    @property
    def _only(self) -> Summary:
        (only,) = self.batch.summaries.values()
        return only

    def __repr__(self) -> str:
        return f"<SweepResult {self.plan.name}: {len(self.table)} runs in {self.out}>"


class ComparisonResult(BatchResult):
    """Results of a comparison of laws on the same layouts."""

    @property
    def scenarios(self) -> dict[str, Summary]:
        """Runs, cells and pairs of each scenario, by the scenario's name."""
        return self.batch.summaries

    @property
    def pooled(self) -> list[Pair]:
        """Comparisons of two values of a field over the runs of all scenarios."""
        return self.batch.pooled

    def __repr__(self) -> str:
        return f"<ComparisonResult {', '.join(self.scenarios)} in {self.out}>"


Found = TypeVar("Found", bound=BatchResult)


def sweep(
    plan: SweepPlan | str | Path,
    out: str | Path | None = None,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    resume: bool = False,
    progress: Callable[[int], None] | None = None,
) -> SweepResult:
    """Runs many variants of a scenario, from a grid of values and from random draws.

    Args:
        plan: Plan of the sweep, or its YAML file (docs/compare.md).
        out: New or empty directory. None means the next number under ``results``.
        workers: Number of local processes. None means one process per processor core.
        scheduler: Address of a Dask scheduler, which then replaces the local processes.
        resume: Whether ``out`` may contain runs of the same plan. These runs are kept.
        progress: Function that is called with the number of finished runs.

    Returns:
        Result with the table of the runs. The directory contains the table, too, and an
        HTML page.

    Raises:
        InputError: An argument or the plan is not valid. The message states the fault
            and the remedy.
        RunError: Every run failed.
    """
    plan = plan if isinstance(plan, SweepPlan) else load_sweep(plan)
    prepared = prepare_sweep(
        plan, out, workers=workers, scheduler=scheduler, resume=resume
    )
    return _finish(prepared, progress)


def prepare_sweep(
    plan: SweepPlan,
    out: str | Path | None,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    resume: bool = False,
) -> Prepared[SweepResult]:
    """Draws and checks the runs, and opens their directory; see ``sweep``."""
    batch = prepare_batch(
        plan, out, workers=workers, scheduler=scheduler, resume=resume
    )
    return _prepared(batch, SweepResult)


def compare(
    *scenarios: str | Path,
    laws: Laws | None = None,
    runs: int | None = None,
    seed: int = 1,
    settings: Mapping[str, Any] | None = None,
    grid: Mapping[str, Sequence[Any]] | None = None,
    worlds: str | Path | None = None,
    every: int = 1,
    names: Sequence[str | int] = (),
    out: str | Path | None = None,
    workers: int | None = None,
    resume: bool = False,
    progress: Callable[[int], None] | None = None,
) -> ComparisonResult:
    """Compares control laws on the same random layouts.

    A layout is one random variant of the positions and motions of all bodies.

    Args:
        *scenarios: Names of scenarios in the library, YAML files of layouts, or YAML
            files of scenarios. If none are given, the four experiments of the papers
            are run, or ``barn`` in worlds.
        laws: Names of the laws, as a list or as one text with commas. Functions and
            classes at the top level of a module may replace names. ``all`` means every
            law for robots of this kind. None means the laws of the papers and
            driving without avoidance. For a scenario with routes, None means the laws
            for routes, and in worlds ``guarded`` and ``dwa``.
        runs: Number of layouts per scenario, or of runs in each world. Every law meets
            each layout. None means 50 layouts, or one run in each world.
        seed: Seed of the layouts and of the noise.
        settings: Values of other fields of the scenarios, by dotted path.
        grid: Lists of values of other fields to compare, by dotted path.
        worlds: Folder with worlds (docs/worlds.md), or ``shipped`` for those that come
            with phonotaxis. They replace obstacles, start and goal of the scenario.
        every: Only worlds whose number is divisible by this number. 6 means the test
            worlds of the BARN challenge.
        names: Names of the worlds. Empty means all.
        out: New or empty directory. None means the next number under ``results``.
        workers: Number of processes. None means one process per processor core.
        resume: Whether ``out`` may contain runs of the same comparison. These runs are
            kept.
        progress: Function that is called with the number of finished runs.

    Returns:
        Result with rates and medians for each law, and with comparisons of two laws
        each. The directory contains them, too, with pictures.

    Raises:
        InputError: An argument is not valid. The message states the fault and the
            remedy.
        RunError: Every run failed.
    """
    chosen = []
    if worlds is not None:
        chosen = chosen_worlds(worlds, every, [*map(str, names)])
    usual = (WORLD_SCENARIO,) if chosen else EXPERIMENTS
    plans = {
        Path(each).stem: comparison_plan(
            str(each),
            laws=laws,
            runs=runs,
            seed=seed,
            settings=dict(settings or {}),
            grid=grid,
            worlds=chosen,
        )
        for each in scenarios or usual
    }
    if len(plans) < len(scenarios):
        raise InputError("scenarios", "a name is listed twice; remove one")
    prepared = prepare_compare(plans, out, workers=workers, resume=resume)
    return _finish(prepared, progress)


def prepare_compare(
    plans: Mapping[str, SweepPlan],
    out: str | Path | None,
    *,
    workers: int | None = None,
    resume: bool = False,
) -> Prepared[ComparisonResult]:
    """Draws and checks the runs, and opens their directory; see ``compare``."""
    batch = prepare_comparison(plans, out, workers=workers, resume=resume)
    return _prepared(batch, ComparisonResult)


def _prepared(batch: PreparedBatch, kind: type[Found]) -> Prepared[Found]:
    return Prepared(
        run=lambda progress: kind(batch.run(progress)),
        total=batch.runs,
        unit="runs",
        done=batch.done,
        left=lambda: (
            f"{batch.done} of {batch.runs} runs are kept: continue with --out "
            f"{batch.out} --resume"
        ),
    )


def _finish(prepared: Prepared[Found], progress: Callable[[int], None] | None) -> Found:
    result = prepared.run(progress or ignore)
    result.write(result.document(), result.out)
    return result
