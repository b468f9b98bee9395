"""Studies of many runs: sweeps, comparisons of laws, and stability analysis."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from analysis.sweeps.plan import SweepPlan, load_sweep
from diagrams.scenario.loading import load_scenario
from diagrams.scenario.scenario import Scenario
from systems.framework.input_error import InputError

if TYPE_CHECKING:
    import pandas as pd

    from analysis.stability.law_analysis import LawAnalysis
    from analysis.sweeps.batch import Batch, PreparedBatch, Summary
    from analysis.sweeps.pairs import Pair

__all__ = [
    "ComparisonResult",
    "StabilityResult",
    "SweepResult",
    "compare",
    "stability",
    "sweep",
]


@dataclass(frozen=True, repr=False)
class SweepResult:
    """Results of a sweep: many runs in one table."""

    batch: Batch
    summary: dict[str, Any]
    """JSON document of ``phonotaxis sweep``."""

    @property
    def plan(self) -> SweepPlan:
        """Plan of the sweep."""
        return self._only.plan

    @property
    def table(self) -> pd.DataFrame:
        """Table with one row per run: fields, ending and metrics (docs/compare.md)."""
        return self._only.rows

    @property
    def out(self) -> Path:
        """Directory of the results, which contains ``report.html``."""
        return self.batch.out

    @property
    def _only(self) -> Summary:
        (only,) = self.batch.summaries.values()
        return only

    def __repr__(self) -> str:
        return f"<SweepResult {self.plan.name}: {len(self.table)} runs in {self.out}>"

    def __str__(self) -> str:
        """Tables of the results, for a terminal."""
        from analysis.sweeps.report import batch_text

        return batch_text(self.batch, self.summary)


@dataclass(frozen=True, repr=False)
class ComparisonResult:
    """Results of a comparison of laws on the same layouts."""

    batch: Batch
    summary: dict[str, Any]
    """JSON document of ``phonotaxis compare``."""

    @property
    def scenarios(self) -> dict[str, Summary]:
        """Runs, cells and pairs of each scenario, by the scenario's name."""
        return self.batch.summaries

    @property
    def pooled(self) -> list[Pair]:
        """Pairs of values of a field, over all scenarios together."""
        return self.batch.pooled

    @property
    def out(self) -> Path:
        """Directory of the results, which contains ``report.html``."""
        return self.batch.out

    def __repr__(self) -> str:
        return f"<ComparisonResult {', '.join(self.scenarios)} in {self.out}>"

    def __str__(self) -> str:
        """Tables of the results, for a terminal."""
        from analysis.sweeps.report import batch_text

        return batch_text(self.batch, self.summary)


@dataclass(frozen=True, repr=False)
class StabilityResult:
    """Stability of a scenario's control loop, under one law or several laws."""

    analyses: list[LawAnalysis]
    """Analysis of each law."""
    summary: dict[str, Any]
    """The JSON document of ``phonotaxis stability``."""

    def __repr__(self) -> str:
        laws = ", ".join(each.law for each in self.analyses)
        return f"<StabilityResult {self.summary['scenario']}: {laws}>"

    def __str__(self) -> str:
        """Verdicts on the stability, for a terminal."""
        from analysis.stability.report_files import stability_text

        return stability_text(self.analyses)

    def save(self, directory: str | Path | None = None) -> Path:
        """Writes all files of ``phonotaxis stability`` into a new directory.

        Args:
            directory: New or empty directory. None means the next number under
                ``results``.

        Returns:
            Path of the directory, which contains ``report.html``.

        Raises:
            InputError: The directory is in use, or cannot be created or written.
        """
        from analysis.reporting.result_directory import whole_directory
        from analysis.stability.report_files import stability_document, write_stability

        with whole_directory(directory) as (shown, partial):
            document = stability_document(self.analyses, shown)
            write_stability(self.analyses, document, partial)
        return shown


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
        Table and summary of the runs. The directory contains both, and an HTML page.

    Raises:
        InputError: An argument or the plan is not valid. The message states the fault
            and the remedy.
        RunError: Every run failed.
    """
    from analysis.sweeps.batch import prepare_batch

    plan = plan if isinstance(plan, SweepPlan) else load_sweep(plan)
    prepared = prepare_batch(
        plan, out, workers=workers, scheduler=scheduler, resume=resume
    )
    return SweepResult(*_done(prepared, progress))


def compare(
    *scenarios: str | Path,
    laws: str | Iterable[str] | None = None,
    runs: int = 50,
    seed: int = 1,
    settings: Mapping[str, Any] | None = None,
    grid: Mapping[str, Sequence[Any]] | None = None,
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
            are run.
        laws: Names of the laws, as a list or as one text with commas. None means the
            laws of the papers and driving without avoidance. For a scenario with
            routes, None means the laws for routes.
        runs: Number of layouts per scenario. Every law meets each layout.
        seed: Seed of the layouts and the noise.
        settings: Values of other fields of the scenarios, by dotted path.
        grid: Lists of values of other fields to compare, by dotted path.
        out: New or empty directory. None means the next number under ``results``.
        workers: Number of processes. None means one process per processor core.
        resume: Whether ``out`` may contain runs of the same comparison. These runs are
            kept.
        progress: Function that is called with the number of finished runs.

    Returns:
        Rates, medians and pairs of laws. The directory also contains them, with
        pictures.

    Raises:
        InputError: An argument is not valid. The message states the fault and the
            remedy.
        RunError: Every run failed.
    """
    from analysis.sweeps.batch import prepare_comparison
    from analysis.sweeps.comparison_plans import EXPERIMENTS, comparison_plan

    chosen = None if laws is None else _names(laws)
    plans = {
        Path(each).stem: comparison_plan(
            str(each),
            laws=chosen,
            runs=runs,
            seed=seed,
            settings=dict(settings or {}),
            grid=grid,
        )
        for each in scenarios or EXPERIMENTS
    }
    if len(plans) < len(scenarios):
        raise InputError("scenarios", "a name is listed twice; remove one")
    prepared = prepare_comparison(plans, out, workers=workers, resume=resume)
    return ComparisonResult(*_done(prepared, progress))


def _done(
    prepared: PreparedBatch, progress: Callable[[int], None] | None
) -> tuple[Batch, dict[str, Any]]:
    """Runs a batch, and writes its files."""
    from analysis.sweeps.page import write_batch
    from analysis.sweeps.report import batch_document

    batch = prepared.run(progress)
    document = batch_document(batch)
    write_batch(batch, document)
    batch.require_runs()
    return batch, document


def stability(
    scenario: Scenario | str | Path = "default",
    *,
    laws: str | Iterable[str] = (),
    robot: str | None = None,
    full: bool = False,
    progress: Callable[[str], None] | None = None,
) -> StabilityResult:
    """Analyzes the stability of a scenario's control loop.

    If the scenario has several robots, only one robot is analyzed. A warning of the
    logger ``phonotaxis`` names the other robots.

    Args:
        scenario: Scenario from ``load_scenario``, name of a scenario in the library, or
            path of a YAML file.
        laws: Names of the control laws to compare, as a list or as one text with
            commas. ``all`` means all laws that avoid obstacles, or all laws for routes.
            An empty list means the law of the scenario.
        robot: Name of the robot to analyze. None means the first robot.
        full: Whether to include the parts that take minutes.
        progress: Function that is called with the name of each part before its
            computation.

    Returns:
        Data of every part, and the verdicts on the stability.

    Raises:
        InputError: The law or the robot does not exist, or the robot has no linear
            model.
    """
    from analysis.stability.choice import chosen_laws, chosen_robot
    from analysis.stability.law_analysis import analyse_law
    from analysis.stability.report_files import stability_document
    from analysis.stability.report_parts import parts_for
    from diagrams.building.laws import make_controller

    if not isinstance(scenario, Scenario):
        scenario = load_scenario(scenario)
    alone, note = chosen_robot(scenario, robot)
    if note:
        logging.getLogger("phonotaxis").warning("%s", note)
    scenarios = chosen_laws(alone, _names(laws))
    for each in scenarios:
        make_controller(each)
    work = parts_for(scenarios, full=full)
    step = progress or (lambda title: None)
    analyses = [analyse_law(each, work, full=full, step=step) for each in scenarios]
    return StabilityResult(analyses, stability_document(analyses, None))


def _names(laws: str | Iterable[str]) -> list[str]:
    """Splits a text at commas; otherwise Python would read each letter as a name."""
    return laws.split(",") if isinstance(laws, str) else list(laws)
