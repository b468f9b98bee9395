"""Rows of a sweep as one table."""

from __future__ import annotations

import io
import json
from collections.abc import Iterable, Sequence
from typing import Any

import pandas as pd

__all__ = ["parquet_bytes", "results_table"]

_FIRST = ("index", "cell", "run", "seed", "redraws")
_TEXTS = ("cause", "collision_object", "collision_fault")
_LAST = ("collision_time_s", "simulated_s", "wall_s")


def results_table(rows: Iterable[dict[str, Any]]) -> pd.DataFrame:
    """The rows of ``Outcome`` by index, the same in whatever order they came.

    Returns:
        A column for each of the row's own values, for each field by its dotted
        path, and for each metric; numbers are float64 but for indices and
        seeds, missing ones NaN. Fields that are lists or mappings, or of
        several kinds, are JSON text.
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
    for name in _LAST[:1]:
        columns[name] = _numbers(row[name] for row in ordered)
    for metric in _keys(ordered, "metrics"):
        columns[metric] = _numbers(row["metrics"].get(metric) for row in ordered)
    for name in _LAST[1:]:
        columns[name] = _numbers(row[name] for row in ordered)
    columns["error"] = pd.array([row["error"] for row in ordered], dtype="str")
    return pd.DataFrame(columns)


def parquet_bytes(table: pd.DataFrame) -> bytes:
    """The table as a Parquet file."""
    buffer = io.BytesIO()
    table.to_parquet(buffer, index=False)
    return buffer.getvalue()


def _keys(rows: Sequence[dict[str, Any]], group: str) -> list[str]:
    """Keys of a mapping in the rows, in order; rows that failed lack some."""
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
