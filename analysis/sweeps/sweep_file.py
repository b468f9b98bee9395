"""The file of a sweep: read and checked before what simulates is loaded."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from diagrams.fields import check_structure
from diagrams.loading import read_mapping
from systems.framework.input_files import require_file

__all__ = ["SWEEP_SCHEMA_FILE", "read_sweep", "sweep_schema"]

SWEEP_SCHEMA_FILE = Path(__file__).with_name("sweep.schema.json")


def read_sweep(path: str | Path) -> dict[str, Any]:
    """The fields of a sweep, each checked by itself.

    Args:
        path: A YAML file with the fields of ``SweepPlan``. Relative paths in
            it begin in its folder.

    Returns:
        Plain values, with the file's folder.

    Raises:
        InputError: The file cannot be read, or fields are unknown or wrong.
    """
    path = require_file(path, "sweep", "YAML")
    data = read_mapping(path)
    for part in ("set", "grid", "draw", "require"):  # a heading with nothing below it
        if part in data and data[part] is None:
            del data[part]
    data.setdefault("name", path.stem)
    check_structure(data, sweep_schema(), "a sweep")
    return {**data, "folder": str(path.parent.absolute())}


def sweep_schema() -> dict[str, Any]:
    """The JSON Schema of a sweep's file, as the package carries it."""
    schema: dict[str, Any] = json.loads(SWEEP_SCHEMA_FILE.read_text("utf-8"))
    return schema
