"""Worlds in two tables: ``cylinders.csv`` and ``paths.csv``."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator
from pathlib import Path

from diagrams.scenario.worlds.world import (
    GOAL_M,
    HEADING_DEG,
    RADIUS_M,
    START_M,
    World,
    cylinder,
)
from systems.framework.input_error import InputError

CYLINDERS, PATHS = "cylinders.csv", "paths.csv"
#: Columns of the tables. Those with a default may be missing.
_CYLINDER = {"x_m": None, "y_m": None, "radius_m": RADIUS_M}
_PATH = {
    "path_length_m": None,
    "start_x_m": START_M[0],
    "start_y_m": START_M[1],
    "start_heading_deg": HEADING_DEG,
    "goal_x_m": GOAL_M[0],
    "goal_y_m": GOAL_M[1],
}


def read_tables(folder: Path) -> dict[str, World]:
    """Reads the worlds of a folder with ``cylinders.csv`` and ``paths.csv``.

    The first table has the columns ``world``, ``x_m`` and ``y_m``, and may have
    ``radius_m``. The second table has the columns ``world`` and ``path_length_m``, and
    may have the start and the goal. The defaults are those of the BARN challenge.

    Args:
        folder: Folder of both tables.

    Returns:
        Worlds by name, in the order of ``paths.csv``.

    Raises:
        InputError: A table is missing, or a row is not complete. The error states the
            line and the remedy.
    """
    cylinders: dict[str, list[dict[str, float]]] = {}
    for _, name, values in _rows(folder / CYLINDERS, _CYLINDER):
        if values["radius_m"] <= 0.0:
            raise InputError(
                str(folder / CYLINDERS),
                f"world {name}: radius_m {values['radius_m']:g} must be positive",
            )
        cylinders.setdefault(name, []).append(values)
    worlds: dict[str, World] = {}
    for line, name, values in _rows(folder / PATHS, _PATH):
        where = f"line {line}: world {name}"
        if name in worlds:
            raise InputError(
                str(folder / PATHS), f"{where} is listed twice; remove one"
            )
        if name not in cylinders:
            raise InputError(
                str(folder / PATHS),
                f"{where} has no cylinders; add them to {CYLINDERS}, or remove the "
                "line",
            )
        if values["path_length_m"] <= 0.0:
            raise InputError(
                str(folder / PATHS), f"{where}: path_length_m must be positive"
            )
        worlds[name] = World(
            name,
            tuple(
                cylinder(k, each["x_m"], each["y_m"], each["radius_m"])
                for k, each in enumerate(cylinders[name], start=1)
            ),
            (values["start_x_m"], values["start_y_m"]),
            values["start_heading_deg"],
            (values["goal_x_m"], values["goal_y_m"]),
            values["path_length_m"],
        )
    for name in cylinders:
        if name not in worlds:
            raise InputError(
                str(folder / PATHS),
                f"has no line for world {name} of {CYLINDERS}; add its path_length_m",
            )
    return worlds


def _rows(
    path: Path, columns: dict[str, float | None]
) -> Iterator[tuple[int, str, dict[str, float]]]:
    """Yields line number, name of the world, and numbers of each row."""
    try:
        with path.open(encoding="utf-8", newline="") as file:
            reader = csv.DictReader(file)
            required = ["world", *(k for k, value in columns.items() if value is None)]
            missing = [k for k in required if k not in (reader.fieldnames or ())]
            if missing:
                raise InputError(
                    str(path),
                    f"has no column {missing[0]}; its first line must name "
                    f"{','.join(required)}",
                )
            for row in reader:
                where = f"line {reader.line_num}"
                name = (row["world"] or "").strip()
                if not name:
                    raise InputError(str(path), f"{where} has no world; give its name")
                yield reader.line_num, name, _numbers(path, where, row, columns)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(str(path), f"cannot be read ({reason})") from None


def _numbers(
    path: Path, where: str, row: dict[str, str], columns: dict[str, float | None]
) -> dict[str, float]:
    values: dict[str, float] = {}
    for column, default in columns.items():
        text = row.get(column, default)
        try:
            values[column] = float(text)  # type: ignore[arg-type]
        except (TypeError, ValueError):
            values[column] = math.nan
        if not math.isfinite(values[column]):
            raise InputError(str(path), f"{where}: {column} is {text!r}; give a number")
    return values
