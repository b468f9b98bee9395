"""The JSON Schema of a scenario, as the package carries it."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

#: ``make schemas`` writes it.
SCHEMA_FILE = Path(__file__).parents[2] / "scenario.schema.json"


def schema_text() -> str:
    """The file's text."""
    return SCHEMA_FILE.read_text("utf-8")


@cache
def scenario_schema() -> dict[str, Any]:
    """The schema; not to be changed."""
    schema: dict[str, Any] = json.loads(schema_text())
    return schema


def known_laws() -> dict[str, str]:
    """Titles of the laws that can be named, by name."""
    named = scenario_schema()["properties"]["law"]["anyOf"]
    return {each["const"]: each["description"] for each in named if "const" in each}
