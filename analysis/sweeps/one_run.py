"""One run of a sweep, and the row that it leaves."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import pandas as pd

from analysis.run_error import RunError
from analysis.runs.metrics import run_metrics
from analysis.sweeps.plan import SweepPoint
from diagrams import RunResult, Scenario, simulate
from systems.framework.input_error import shortened

__all__ = ["Outcome", "Task", "lost_outcome", "require_runs", "run_task"]

#: Cause in the row of a run that raised an error.
FAILED = "failed"


@dataclass(frozen=True)
class Task:
    """What a worker is given."""

    point: SweepPoint
    scenario: Scenario
    trajectory: bool
    """Whether the trajectory is wanted."""


@dataclass(frozen=True)
class Outcome:
    """What a worker gives back."""

    row: dict[str, Any]
    """Plain values: the point's own (``fields`` a mapping), ``cause``,
    ``collision_object``, ``collision_fault``, ``collision_time_s``, ``robots`` (the
    same of each of several, ``<name>.cause`` ...), ``metrics``
    (a mapping), ``simulated_s``, ``wall_s`` and ``error``."""
    trajectory: bytes | None = None
    """A Parquet file."""


def run_task(task: Task) -> Outcome:
    """Runs a point. Whatever the run raises becomes its row."""
    start = perf_counter()
    try:
        result = simulate(task.scenario)
        row = _row(task.point, result.cause, start, result)
        trajectory = _trajectory(result) if task.trajectory else None
    except (Exception, SystemExit) as error:  # noqa: BLE001  # the rest must go on
        text = " ".join(f"{type(error).__name__}: {error}".split())
        return Outcome(_row(task.point, FAILED, start, error=text))
    return Outcome(row, trajectory)


def require_runs(tables: Sequence[pd.DataFrame], out: Path) -> None:
    """Refuses results that hold no run but failed ones.

    Args:
        tables: Results, one a sweep; see ``load_results``.
        out: The directory, for the message.

    Raises:
        RunError: All failed; says how the first one did.
    """
    causes = [cause for table in tables for cause in table["cause"]]
    if causes and all(cause == FAILED for cause in causes):
        raise RunError(
            f"all {len(causes)} runs failed, the first one by "
            f"{shortened(str(tables[0]['error'].iloc[0]), 160)}; {out} keeps them"
        )


def lost_outcome(task: Task, reason: str) -> Outcome:
    """The outcome of a run whose worker ended each time.

    Args:
        task: What was to be run.
        reason: What became of the worker.

    Returns:
        A failed run, with the reason as its error.
    """
    return Outcome(_row(task.point, FAILED, perf_counter(), error=reason))


def _row(
    point: SweepPoint,
    cause: str,
    start: float,
    result: RunResult | None = None,
    error: str | None = None,
) -> dict[str, Any]:
    collision = result.collision if result else None
    metrics = run_metrics(result) if result else {}
    for name, value in metrics.items():
        if value is not None and not math.isfinite(value):
            raise ValueError(f"{name} is {value}")
    return {
        "index": point.index,
        "cell": point.cell,
        "run": point.run,
        "seed": point.seed,
        "redraws": point.redraws,
        "fields": point.fields,
        "cause": cause,
        "collision_object": collision.object if collision else None,
        "collision_fault": collision.fault if collision else None,
        "collision_time_s": collision.time if collision else None,
        "robots": _endings(result) if result else {},
        "metrics": metrics,
        "simulated_s": result.simulated_s if result else None,
        "error": error,
        "wall_s": perf_counter() - start,
    }


def _endings(result: RunResult) -> dict[str, str | None]:
    """How each of several robots ended, by its name, a dot and the row's name."""
    endings: dict[str, str | None] = {}
    for name, own in result.several.items():
        hit = own.collision
        endings[f"{name}.cause"] = own.cause
        endings[f"{name}.collision_object"] = hit.object if hit else None
        endings[f"{name}.collision_fault"] = hit.fault if hit else None
    return endings


def _trajectory(result: RunResult) -> bytes:
    buffer = io.BytesIO()
    result.trajectory.to_parquet(buffer, index=False)
    return buffer.getvalue()
