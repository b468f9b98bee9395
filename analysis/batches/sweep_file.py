"""The YAML file of a sweep."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from diagrams.scenario.loading import read_mapping
from systems.framework.input_files import require_file

SWEEP_SCHEMA_FILE = Path(__file__).with_name("sweep.schema.json")


def read_sweep(path: str | Path) -> dict[str, Any]:
    """Reads the fields of a parameter sweep from a YAML file without checking them.

    The result also has the folder of the file as ``folder``. Raises InputError if the
    file cannot be read.
    """
    path = require_file(path, "sweep", "YAML")
    data = read_mapping(path)
    for part in ("set", "grid", "draw", "require"):  # a heading with nothing below it
        if part in data and data[part] is None:
            del data[part]
    data.setdefault("name", path.stem)
    return {**data, "folder": str(path.parent.absolute())}
