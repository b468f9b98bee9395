"""The JSON Schema of a scenario that the package contains."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

#: ``make schemas`` writes this file.
SCHEMA_FILE = Path(__file__).parents[2] / "scenario.schema.json"


def schema_text() -> str:
    """Text of the schema file."""
    return SCHEMA_FILE.read_text("utf-8")


@cache
def scenario_schema() -> dict[str, Any]:
    """The schema; callers must not change it."""
    schema: dict[str, Any] = json.loads(schema_text())
    return schema


def known_laws() -> dict[str, str]:
    """Titles of the laws in the package, by name."""
    named = scenario_schema()["properties"]["law"]["anyOf"]
    return {each["const"]: each["description"] for each in named if "const" in each}
