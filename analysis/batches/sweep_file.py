"""The YAML file of a sweep."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from diagrams.scenario.fields.shipped import scenario_schema
from diagrams.scenario.loading import library_scenarios, read_mapping
from systems.framework.input_error import InputError
from systems.framework.input_files import require_file

#: Fields that only sweeps have; ``name`` and ``seed`` are fields of scenarios, too.
_ONLY_SWEEPS = {"scenario", "set", "grid", "draw", "require", "runs", "redraws"}
SWEEP_SCHEMA_FILE = Path(__file__).with_name("sweep.schema.json")


def read_sweep(path: str | Path) -> dict[str, Any]:
    """Reads the fields of a parameter sweep from a YAML file without checking them.

    The result also has the folder of the file as ``folder``. Raises InputError if the
    file cannot be read.
    """
    if str(path) in library_scenarios():
        raise InputError(
            "sweep",
            f"{path} is a scenario; write 'scenario: {path}' into a sweep file, or use "
            f"'phonotaxis compare {path}'",
        )
    path = require_file(path, "sweep", "YAML")
    data = read_mapping(path)
    for part in ("set", "grid", "draw", "require"):  # a heading with nothing below it
        if part in data and data[part] is None:
            del data[part]
    _require_sweep(path, data)
    data.setdefault("name", path.stem)
    return {**data, "folder": str(path.parent.absolute())}


def _require_sweep(path: Path, data: dict[str, Any]) -> None:
    """Rejects the file of a scenario, and fields of the scenario outside of ``set``."""
    fields = scenario_schema()["properties"].keys() - {"name", "seed"}
    misplaced = [key for key in data if key in fields]
    if misplaced and not _ONLY_SWEEPS & data.keys():
        raise InputError(
            str(path),
            f"is a scenario; a sweep names it by 'scenario: {path.name}', and has a "
            f"grid or runs; or use 'phonotaxis compare {path}'",
        )
    faults = [
        InputError(key, f"is a field of the scenario; write 'set: {{{key}: ...}}'")
        for key in misplaced
    ]
    if faults:
        raise InputError.joined(faults)
