"""The file of a sweep: read and checked before what simulates is loaded."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from diagrams.fields import check_structure
from diagrams.loading import read_mapping
from systems.framework.input_error import InputError

__all__ = ["SWEEP_SCHEMA_FILE", "read_sweep"]

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
    path = Path(path)
    if not path.is_file():
        raise InputError("sweep", f"there is no file {path}; check the path")
    data = read_mapping(path)
    for part in ("set", "grid", "draw", "require"):  # a heading with nothing below it
        if part in data and data[part] is None:
            del data[part]
    data.setdefault("name", path.stem)
    schema = json.loads(SWEEP_SCHEMA_FILE.read_text("utf-8"))
    schema["properties"]["folder"] = {"type": "string"}
    data["folder"] = str(path.parent.absolute())
    check_structure(data, schema, "a sweep")
    return data
