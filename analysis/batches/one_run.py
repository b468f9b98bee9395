"""One run of a sweep, its row of results, and the table of all rows."""

from __future__ import annotations

import io
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from time import perf_counter
from typing import Any

import pandas as pd

from analysis.batches.plan import SweepPoint
from analysis.run_error import RunError
from analysis.runs.metric_table import run_metrics
from diagrams import RunResult, Scenario, simulate
from diagrams.running.stop_rules import Collision
from diagrams.scenario.own_code import is_interrupt
from diagrams.scenario.own_versions import code_of_sweep
from diagrams.scenario.run_parameters import Engine
from diagrams.scenario.warnings.warnings_of import warnings_of
from systems.framework.input_error import shortened

#: Cause of the end of a run that raised an error.
FAILED = "failed"
_FIRST = ("index", "cell", "run", "seed", "redraws")
_TEXTS = ("cause", "collision_object", "collision_fault")
#: Types of the values of a row that was read from JSON.
_NUMBER, _TEXT = (float, int, type(None)), (str, type(None))
_KINDS: dict[str, Any] = {
    **dict.fromkeys(_FIRST, int),
    **dict.fromkeys((*_TEXTS, "engine", "error"), _TEXT),
    **dict.fromkeys(("collision_time_s", "simulated_s", "wall_s"), _NUMBER),
    **dict.fromkeys(("fields", "robots", "metrics"), dict),
}


@dataclass(frozen=True)
class Task:
    """A run that a worker has to do."""

    point: SweepPoint
    scenario: Scenario
    engine: Engine
    """Engine for the run: ``drake`` or ``compiled``."""
    trajectory: bool
    """Whether to return the trajectory, the table with one row per tick."""
    files: Mapping[str, str] = field(default_factory=dict)
    """SHA-256 of each input file when the sweep started, by absolute path."""


@dataclass(frozen=True)
class Outcome:
    """Results of a run that a worker has done."""

    row: dict[str, Any]
    """Plain values by name:

    - The fields of ``SweepPoint``. ``fields`` is a mapping.
    - ``cause``, ``collision_object``, ``collision_fault``, ``collision_time_s``.
    - ``robots``: mapping with the ending of each of several robots. Its keys are
      ``<name>.cause``, ``<name>.collision_object`` and ``<name>.collision_fault``.
    - ``metrics``: mapping from the name of each metric to its value.
    - ``simulated_s``, ``wall_s``, ``engine``, ``error``.
    - ``warnings``: list of mappings with ``field`` and ``message``."""
    trajectory: bytes | None = None
    """Trajectory of the run as the contents of a Parquet file, or None."""


def run_task(task: Task) -> Outcome:
    """Runs a scenario; if the run raises an error, the row states the error."""
    start = perf_counter()
    try:
        with code_of_sweep(task.scenario, task.files):
            result = simulate(task.scenario, engine=task.engine)
        row = _row(task, result.cause, start, result)
        trajectory = parquet_bytes(result.trajectory) if task.trajectory else None
    except BaseException as error:  # the other runs must go on
        if is_interrupt(error):
            raise
        text = " ".join(f"{type(error).__name__}: {error}".split())
        return Outcome(_row(task, FAILED, start, error=text))
    return Outcome(row, trajectory)


def require_runs(tables: Sequence[pd.DataFrame], out: Path) -> None:
    """Raises RunError with the error of the first run if every run failed."""
    causes = [cause for table in tables for cause in table["cause"]]
    if causes and all(cause == FAILED for cause in causes):
        raise RunError(
            f"all {len(causes)} runs failed, the first one by "
            f"{shortened(str(tables[0]['error'].iloc[0]), 160)}; {out} keeps them"
        )


def lost_outcome(task: Task, reason: str) -> Outcome:
    """Makes the result of a run during which its worker ended, at every attempt."""
    return Outcome(_row(task, FAILED, perf_counter(), error=reason))


def _row(
    task: Task,
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
        **vars(task.point),
        **_ending(cause, collision),
        "collision_time_s": collision and collision.time,
        "robots": {
            f"{name}.{key}": value
            for name, own in (result.several if result else {}).items()
            for key, value in _ending(own.cause, own.collision).items()
        },
        "metrics": metrics,
        "simulated_s": result.simulated_s if result else None,
        "engine": task.engine,
        "error": error,
        "warnings": [asdict(each) for each in warnings_of(task.scenario)],
        "wall_s": perf_counter() - start,
    }


def _ending(cause: str, hit: Collision | None) -> dict[str, Any]:
    return {
        "cause": cause,
        "collision_object": hit and hit.object,
        "collision_fault": hit and hit.fault,
    }


def is_row(value: Any) -> bool:
    """Whether a value from a JSON file has the form of ``Outcome.row``."""
    return (
        isinstance(value, dict)
        and all(isinstance(value.get(name, ...), kind) for name, kind in _KINDS.items())
        and all(isinstance(number, _NUMBER) for number in value["metrics"].values())
        and all(isinstance(text, _TEXT) for text in value["robots"].values())
    )


def results_table(rows: Iterable[dict[str, Any]]) -> pd.DataFrame:
    """Makes a table of the rows of all runs, sorted by the number of the run.

    The table has these columns:

    - Each value of ``Outcome.row`` that is not a mapping.
    - Each field of the parameter sweep, by its dotted path.
    - The ending of each robot, for example ``<name>.cause``, if there are several.
    - Each metric.

    The types are as follows:

    - ``index``, ``cell``, ``run``, ``seed`` and ``redraws`` are integers.
    - Metrics and times are float64. A missing number is NaN.
    - Warnings are JSON text.
    - A field is JSON text if its values are lists or mappings, or have different types.
    """
    ordered = sorted(rows, key=lambda row: int(row["index"]))
    columns: dict[str, Any] = {
        name: pd.array([row[name] for row in ordered], dtype="int64") for name in _FIRST
    }
    for path in _keys(ordered, "fields"):
        columns[path] = _field_column([row["fields"][path] for row in ordered])
    for name in _TEXTS:
        columns[name] = pd.array([row[name] for row in ordered], dtype="str")
    for name in _keys(ordered, "robots"):
        values = [row["robots"].get(name) for row in ordered]
        columns[name] = pd.array(values, dtype="str")
    columns["collision_time_s"] = _numbers(row["collision_time_s"] for row in ordered)
    for metric in _keys(ordered, "metrics"):
        columns[metric] = _numbers(row["metrics"].get(metric) for row in ordered)
    for name in ("simulated_s", "wall_s"):
        columns[name] = _numbers(row[name] for row in ordered)
    for name in ("engine", "error"):
        columns[name] = pd.array([row[name] for row in ordered], dtype="str")
    warnings = [json.dumps(row["warnings"]) for row in ordered]
    columns["warnings"] = pd.array(warnings, dtype="str")
    return pd.DataFrame(columns)


def table_rows(
    table: pd.DataFrame, points: Mapping[int, SweepPoint]
) -> list[dict[str, Any]]:
    """Returns the rows from which ``results_table`` has made a table.

    The argument ``points`` contains the point of each run, by number of the run.
    """
    names = list(table.columns)
    end, first = names.index("collision_time_s"), names.index(_TEXTS[-1])
    robots = names[first + 1 : end]
    metrics = names[end + 1 : names.index("simulated_s")]
    rows, known = [], table.notna().to_numpy()
    for number, values in enumerate(table.to_dict("records")):
        given = zip(values.items(), known[number], strict=True)
        plain = {name: value if is_known else None for (name, value), is_known in given}
        rows.append(
            {
                **vars(points[int(table["index"].iloc[number])]),
                **{name: plain[name] for name in _TEXTS},
                "collision_time_s": plain["collision_time_s"],
                "robots": {name: plain[name] for name in robots},
                "metrics": {name: plain[name] for name in metrics},
                "simulated_s": plain["simulated_s"],
                "engine": plain["engine"],
                "error": plain["error"],
                "warnings": json.loads(values["warnings"]),
                "wall_s": plain["wall_s"],
            }
        )
    return rows


def parquet_bytes(table: pd.DataFrame) -> bytes:
    """Returns the contents of a Parquet file with the table."""
    buffer = io.BytesIO()
    table.to_parquet(buffer, index=False)
    return buffer.getvalue()


def _keys(rows: Sequence[dict[str, Any]], group: str) -> list[str]:
    """Returns the keys of the mapping ``group`` that occur in any row, in order."""
    return list(dict.fromkeys(key for row in rows for key in row[group]))


def _numbers(values: Iterable[float | None]) -> Any:
    return pd.Series(list(values), dtype="float64")


def _field_column(values: list[Any]) -> Any:
    for kind, dtype in ((bool, "bool"), (int, "int64"), (str, "str")):
        if all(type(value) is kind for value in values):
            return pd.Series(values, dtype=dtype)
    if all(type(value) in (int, float) for value in values):
        return pd.Series(values, dtype="float64")
    return pd.Series([json.dumps(value) for value in values], dtype="str")
