"""Many runs, laws side by side, and stability: what a script gets of them."""

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

    from analysis.comparison.laws_in_pairs import Comparison, Pair
    from analysis.stability.law_analysis import LawAnalysis

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
    """Many runs in one table."""

    plan: SweepPlan
    table: pd.DataFrame
    """A row a run: its fields, how it ended, metrics (docs/compare.md)."""
    summary: dict[str, Any]
    """The JSON document of ``phonotaxis sweep``."""
    out: Path
    """The directory, with ``report.html``."""

    def __repr__(self) -> str:
        return f"<SweepResult {self.plan.name}: {len(self.table)} runs in {self.out}>"

    def __str__(self) -> str:
        """Tables on one screen."""
        from analysis.sweeps.summary import sweep_text

        return sweep_text(self.plan, self.table)


@dataclass(frozen=True, repr=False)
class ComparisonResult:
    """Laws side by side on the same layouts."""

    comparisons: dict[str, Comparison]
    """Cells and pairs by name of the scenario."""
    pooled: list[Pair]
    """Pairs of laws over all scenarios together."""
    summary: dict[str, Any]
    """The JSON document of ``phonotaxis compare``."""
    out: Path
    """The directory."""

    def __repr__(self) -> str:
        return f"<ComparisonResult {', '.join(self.comparisons)} in {self.out}>"

    def __str__(self) -> str:
        """Tables on one screen."""
        from analysis.comparison.report_text import compare_text

        return compare_text(self.summary, self.comparisons, self.pooled)


@dataclass(frozen=True, repr=False)
class StabilityResult:
    """The stability of a scenario's loop, under one law or several."""

    analyses: list[LawAnalysis]
    """One a law."""
    summary: dict[str, Any]
    """The JSON document of ``phonotaxis stability``."""

    def __repr__(self) -> str:
        laws = ", ".join(each.law for each in self.analyses)
        return f"<StabilityResult {self.summary['scenario']}: {laws}>"

    def __str__(self) -> str:
        """The verdicts on one screen."""
        from analysis.stability.report_files import stability_text

        return stability_text(self.summary)

    def save(self, directory: str | Path | None = None) -> Path:
        """Writes all that ``phonotaxis stability`` does into a new directory.

        Args:
            directory: It; none: the next number under ``results``.

        Returns:
            The directory; ``report.html`` is in it.

        Raises:
            InputError: It is in use, or cannot be made or written.
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
    """Runs many scenarios, drawn from distributions and grids.

    Args:
        plan: What to run, or the YAML file that says it (docs/compare.md).
        out: A new directory; none: the next number under ``results``.
        workers: Number of local processes; none: one a core.
        scheduler: Address of a Dask scheduler to use instead.
        resume: Whether ``out`` may hold runs of the same plan, which are kept.
        progress: Called with the number of runs done.

    Returns:
        Table and summary; the directory has them, too, and a page.

    Raises:
        InputError: Something of that is no good; says what, and the remedy.
        RunError: Every run failed.
    """
    from analysis.sweeps.one_run import require_runs
    from analysis.sweeps.page import write_sweep
    from analysis.sweeps.summary import sweep_summary
    from analysis.sweeps.sweep import prepare_sweep

    plan = plan if isinstance(plan, SweepPlan) else load_sweep(plan)
    prepared = prepare_sweep(
        plan, out, workers=workers, scheduler=scheduler, resume=resume
    )
    table = prepared.run(progress)
    directory = prepared.store.out
    summary = sweep_summary(plan, prepared.points, table, directory)
    write_sweep(plan, prepared.points, table, summary)
    require_runs([table], directory)
    return SweepResult(plan, table, summary, directory)


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
    """Runs laws side by side on the same random layouts.

    Args:
        *scenarios: Library names, YAML files of layouts, or YAML files of
            scenarios; none: the papers' four experiments.
        laws: What to compare, in one text parted by commas or one by one; none: the
            papers' and no avoidance, or those for routes.
        runs: Layouts a scenario, each met by every law.
        seed: Of layouts and noise.
        settings: Further fields of the scenarios, by dotted path.
        grid: Further fields to compare, with their values.
        out: A new directory; none: the next number under ``results``.
        workers: Number of processes; none: one a core.
        resume: Whether ``out`` may hold runs of the same comparison.
        progress: Called with the number of runs done.

    Returns:
        Rates, medians and pairs; the directory has them, too, with pictures.

    Raises:
        InputError: Something of that is no good; says what, and the remedy.
        RunError: Every run failed.
    """
    from analysis.comparison.compare import prepare_comparison
    from analysis.comparison.plans import EXPERIMENTS, comparison_plan
    from analysis.comparison.report import compare_summary, write_comparison

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
    comparisons, pooled = prepared.run(progress)
    summary = compare_summary(prepared, comparisons, pooled)
    write_comparison(prepared, comparisons, pooled, summary)
    return ComparisonResult(comparisons, pooled, summary, prepared.out)


def stability(
    scenario: Scenario | str | Path = "default",
    *,
    laws: str | Iterable[str] = (),
    robot: str | None = None,
    full: bool = False,
    progress: Callable[[str], None] | None = None,
) -> StabilityResult:
    """Analyses the stability of a scenario's loop.

    Args:
        scenario: From ``load_scenario``, or a name or file for it.
        laws: To compare, in one text parted by commas or one by one; ``all``: those
            that avoid obstacles, or drive on a route; none: the scenario's.
        robot: Of several robots, the one to analyse, alone; none: the first.
        full: Everything, also what takes minutes.
        progress: Called with the name of each part before it is computed.

    Returns:
        Every part's data, and verdicts. Where other robots are left out, a warning
        of the logger ``phonotaxis`` names them.

    Raises:
        InputError: There is no such law or robot, or it has no linear model.
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
    analyses = [analyse_law(each, work, step=step) for each in scenarios]
    return StabilityResult(analyses, stability_document(analyses, None))


def _names(laws: str | Iterable[str]) -> list[str]:
    """A text would be read letter by letter."""
    return laws.split(",") if isinstance(laws, str) else list(laws)
