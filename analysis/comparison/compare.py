"""Runs laws side by side on the same random layouts."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from analysis.comparison.laws_in_pairs import (
    Comparison,
    Pair,
    compare_runs,
    pooled_pairs,
)
from analysis.comparison.words import (
    EXPERIMENTS,
    VELOCITY_TERM,
    library_layouts,
    listed_values,
    whole_seed,
)
from analysis.reporting.result_directory import ResultDirectory, take_directory
from analysis.sweeps.one_run import require_runs
from analysis.sweeps.plan import SweepPlan, load_sweep
from analysis.sweeps.sweep import PreparedSweep, prepare_sweep
from diagrams import Scenario, load_scenario
from diagrams.fields import explain
from diagrams.loading import parse_setting, read_mapping, scenario_from_mapping
from systems.framework.input_error import InputError
from systems.laws.catalogue import FORCE_LAWS, LAWS

__all__ = [
    "PreparedComparison",
    "comparison_plan",
    "comparison_plans",
    "prepare_comparison",
]

#: Fields of a sweep that a comparison sets itself.
_OURS = ("grid", "runs", "pair")


@dataclass(frozen=True)
class PreparedComparison:
    """A comparison that has only to be run; see ``prepare_comparison``."""

    out: Path
    sweeps: dict[str, PreparedSweep]
    """By name of the scenario."""

    @property
    def runs(self) -> int:
        """Runs of all experiments and laws together."""
        return sum(len(sweep.points) for sweep in self.sweeps.values())

    @property
    def done(self) -> int:
        """Those of them that are done."""
        return sum(len(sweep.store.done) for sweep in self.sweeps.values())

    def run(
        self, progress: Callable[[int], None] | None = None
    ) -> tuple[dict[str, Comparison], list[Pair]]:
        """Does the runs and summarises each scenario.

        Args:
            progress: Called a few times a second with the number of runs done.

        Returns:
            Comparisons by name of the scenario, and the pairs of all together.

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


def comparison_plan(
    scenario: str,
    *,
    laws: Iterable[str] | None = None,
    runs: int = 50,
    seed: int = 1,
    settings: dict[str, Any] | None = None,
    grid: Mapping[str, Sequence[Any]] | None = None,
) -> SweepPlan:
    """The paired sweep that compares laws on one experiment's layouts.

    Args:
        scenario: A library name, whose layouts are those of the library; a YAML
            file of layouts (a sweep without grid, runs and pair); or a YAML file
            of a scenario, whose runs differ in noise alone.
        laws: What to compare, each as that of all robots; none: the papers' and no
            avoidance, or those for routes.
        runs: Layouts, each met by every law.
        seed: Of all layouts and noise.
        settings: Further fields of the scenario, by dotted path.
        grid: Further fields to compare, with their values.

    Returns:
        The sweep: ``law`` is the first axis of its grid, and ``pair`` is set.

    Raises:
        InputError: Something of that is unknown or no good; names the field.
    """
    plan = _layouts(scenario)
    base = scenario_from_mapping(plan.base)
    _require_one_law(base)
    if laws is None:
        on_route = [name for name, law in LAWS.items() if law.on_route]
        routed = any(robot.route for robot in base.all_robots.values())
        laws = on_route if routed else FORCE_LAWS
    fields = {name: getattr(plan, name) for name in SweepPlan.model_fields}
    fields |= {
        "set": plan.set | (settings or {}),
        "grid": {"law": tuple(laws), **{k: tuple(v) for k, v in (grid or {}).items()}},
        "runs": runs,
        "seed": seed,
        "pair": True,
    }
    try:
        return SweepPlan.model_validate(fields)
    except ValidationError as error:
        raise explain(error, SweepPlan.model_json_schema(), "a comparison") from None


def _require_one_law(base: Scenario) -> None:
    """Refuses what a comparison could not set: all robots get its law."""
    if base.searches is not None:
        raise InputError(
            "scenario",
            f"{base.name!r} is a search by law {base.law!r}, for which no other law "
            "stands in; sweep its fields, as search.rules (docs/olfaction.md)",
        )
    for name, changes in base.robots.items():
        if "law" in changes:
            raise InputError(
                f"robots.{name}.law",
                f"is {changes['law']!r}, but a comparison gives all robots its laws; "
                "leave it out",
            )


def comparison_plans(
    scenarios: Sequence[str] = (),
    *,
    laws: str | None = None,
    velocity_terms: str | None = None,
    runs: int = 50,
    seed: str | None = None,
    settings: Iterable[str] = (),
    grid: Iterable[str] = (),
) -> dict[str, SweepPlan]:
    """A plan for each scenario, by its name.

    Args:
        scenarios: See ``comparison_plan``; none: the papers' experiments.
        laws: Names parted by commas; none: see ``comparison_plan``.
        velocity_terms: ``printed``, ``closing``, or both parted by a comma.
        runs: Layouts a scenario.
        seed: A whole number.
        settings: ``key=value``.
        grid: ``key=[value, ...]``.

    Returns:
        In the order of ``scenarios``; names without folder and ending.

    Raises:
        InputError: A word is no good; names the option or the field.
    """
    fields = dict(parse_setting(text) for text in settings)
    varied = dict(listed_values(text) for text in grid)
    if velocity_terms is not None:
        terms = velocity_terms.split(",")
        if len(terms) == 1:
            fields[VELOCITY_TERM] = terms[0]
        else:
            varied[VELOCITY_TERM] = terms
    plans: dict[str, SweepPlan] = {}
    for scenario in scenarios or EXPERIMENTS:
        name = Path(scenario).stem
        if name in plans:
            raise InputError("scenario", f"{name} stands there twice; drop one")
        plans[name] = comparison_plan(
            scenario,
            laws=None if laws is None else laws.split(","),
            runs=runs,
            seed=whole_seed(seed),
            settings=fields,
            grid=varied,
        )
    return plans


def prepare_comparison(
    plans: dict[str, SweepPlan],
    out: str | Path | None = None,
    *,
    workers: int | None = None,
    resume: bool = False,
) -> PreparedComparison:
    """Draws and checks all layouts, and opens the directories of the runs.

    Args:
        plans: By name of the scenario; see ``comparison_plan``.
        out: The directory; none: the next number under results/.
        workers: Number of processes; none: one a core.
        resume: Whether ``out`` may hold runs of the same comparison.

    Returns:
        The comparison, to be run once; its directories are locked until then.

    Raises:
        InputError: Something of that is no good; says what, and the remedy.
    """
    if resume and out is None:
        raise InputError("out", "--resume needs the directory to go on with; name it")
    directory = Path(out).expanduser() if out is not None else None
    taken: ResultDirectory | None = None
    if directory is None or not (resume and directory.exists()):
        taken = take_directory(out)
        directory = directory or Path("results") / taken.path.name
    sweeps: dict[str, PreparedSweep] = {}
    try:
        for name, plan in plans.items():
            sweeps[name] = prepare_sweep(
                plan, directory / name, workers=workers, resume=resume
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


def _layouts(scenario: str) -> SweepPlan:
    library = library_layouts()
    if scenario in library:
        return load_sweep(library[scenario])
    path = Path(scenario)
    if path.suffix in (".yaml", ".yml") and path.is_file():
        data = read_mapping(path)
        if "scenario" in data:
            for key in _OURS:
                if key in data:
                    raise InputError(
                        f"{scenario}: {key}",
                        "is for the comparison to set; remove it, or use sweep",
                    )
            return load_sweep(path)
    load_scenario(scenario)
    return SweepPlan(name=path.stem, scenario=scenario)
