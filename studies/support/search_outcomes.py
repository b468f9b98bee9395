"""How searches end over many runs: shares with intervals, causes, steps and times."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from os import cpu_count
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.batches.one_run import Task, results_table, run_task
from analysis.batches.plan import load_sweep
from analysis.report.intervals import Estimate, estimate_rate

#: Of the starts.
SEED = 2026


@dataclass(frozen=True)
class SearchOutcomes:
    """Of one kind of run."""

    runs: int
    found: int
    """Runs in which every robot found what it searched for."""
    within: int
    """Of these, those in which no robot took more than ``most_steps``."""
    most_steps: int
    causes: dict[str, int]
    """How the others ended, the most frequent first."""
    median_steps: float | None
    """Of the runs that found."""
    median_time_s: float | None
    """Of the runs that found, s."""
    median_efficiency: float | None
    """Straight way over the way that was gone, of the runs that found."""

    @property
    def share(self) -> Estimate:
        """Share within the steps."""
        return estimate_rate(self.within, self.runs)

    @property
    def found_share(self) -> Estimate:
        """Share that found at all."""
        return estimate_rate(self.found, self.runs)


def search_runs(
    layouts: Path,
    runs: int,
    settings: Mapping[str, Any] | None = None,
    *,
    seed: int = SEED,
    draw: Mapping[str, Any] | None = None,
) -> pd.DataFrame:
    """Runs searches from random starts, in compiled loops, on all processors.

    Args:
        layouts: File of a sweep, one of ``diagrams/layouts``.
        runs: Starts.
        settings: Fields of the scenario that differ, by dotted path.
        seed: Of all of them.
        draw: Distributions in the place of those of the layouts, by path.

    Returns:
        A row a run, as a sweep has it.
    """
    plan = load_sweep(layouts)
    drawn = plan.model_dump(exclude_unset=True)["draw"] | (draw or {})
    plan = type(plan).model_validate(
        {name: getattr(plan, name) for name in type(plan).model_fields}
        | {"set": {**plan.set, **(settings or {})}}
        | {"draw": drawn, "runs": runs, "seed": seed}
    )
    tasks = [
        Task(point, plan.scenario_of(point), "compiled", trajectory=False)
        for point in plan.points()
    ]
    first = run_task(tasks[0])  # compiles for all processes
    context = get_context("forkserver")
    with ProcessPoolExecutor(cpu_count(), mp_context=context) as pool:
        others = list(pool.map(run_task, tasks[1:], chunksize=4))
    return results_table(outcome.row for outcome in (first, *others))


def search_outcomes(
    table: pd.DataFrame, robots: Sequence[str] = (), most_steps: int = 10
) -> SearchOutcomes:
    """Outcomes of the rows of a sweep.

    Args:
        table: Results of a sweep, see ``load_results``.
        robots: Names of those that count, where there are several.
        most_steps: That a search may take.

    Returns:
        Their number, and what became of them.
    """
    prefixes = [f"{name}." for name in robots] or [""]
    causes = [table[f"{prefix}cause"].astype(str).to_numpy() for prefix in prefixes]
    found = np.all([cause == "found" for cause in causes], axis=0)
    steps = _largest(table, prefixes, "search_steps")
    times = _largest(table, prefixes, "search_time_s")
    failed = Counter(
        next(
            f"{prefix}{cause[k]}"
            for prefix, cause in zip(prefixes, causes, strict=True)
            if cause[k] != "found"
        )
        for k in np.flatnonzero(~found)
    )
    efficiency = table[f"{prefixes[0]}path_efficiency"].to_numpy(dtype=float)
    return SearchOutcomes(
        len(table),
        int(found.sum()),
        int((found & (steps <= most_steps)).sum()),
        most_steps,
        dict(failed.most_common()),
        *(
            float(np.median(values[found])) if found.any() else None
            for values in (steps, times, efficiency)
        ),
    )


def _largest(
    table: pd.DataFrame, prefixes: Sequence[str], name: str
) -> NDArray[np.float64]:
    columns = [table[f"{p}{name}"].to_numpy(dtype=float) for p in prefixes]
    return np.asarray(np.max(columns, axis=0))
