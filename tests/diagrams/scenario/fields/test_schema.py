"""The schemas that are shipped: as the models have it, and true of every file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from analysis.batches.sweep_file import SWEEP_SCHEMA_FILE
from diagrams.scenario.fields.shipped import SCHEMA_FILE
from diagrams.scenario.loading import read_mapping
from tools.scenario_schema import make_schema
from tools.sweep_schema import make_sweep_schema

ROOT = Path(__file__).parents[4]
MADE = {SCHEMA_FILE: make_schema, SWEEP_SCHEMA_FILE: make_sweep_schema}
FILES = sorted(
    path
    for folder in ("diagrams/scenarios", "diagrams/layouts", "docs/examples")
    for path in (ROOT / folder).glob("*.yaml")
)


def shipped(path: Path) -> Any:
    return json.loads(path.read_text("utf-8"))


@pytest.mark.parametrize("path", MADE, ids=lambda path: path.name)
def test_shipped_schema_is_that_of_the_models(path: Path) -> None:
    """If they differ: make schemas."""
    assert shipped(path) == MADE[path]()
    jsonschema.Draft202012Validator.check_schema(shipped(path))


@pytest.mark.parametrize(
    "path", FILES, ids=lambda path: f"{path.parent.name}/{path.stem}"
)
def test_every_file_names_its_schema_and_keeps_it(path: Path) -> None:
    first = path.read_text("utf-8").partition("\n")[0]
    name = first.removeprefix("# yaml-language-server: $schema=")
    schema = (path.parent / name).resolve()
    assert schema in MADE
    validator = jsonschema.Draft202012Validator(shipped(schema))
    assert not list(validator.iter_errors(read_mapping(path)))


@pytest.mark.parametrize(
    "wrong",
    [
        {"room": {"reverberation_time": 0.3}},
        {"law": "activ"},
        {"obstacles": [{"size_m": [0.1]}]},
        {"robots": {"one": {"tdoa": {"band_hz": [-1, 300]}}}},
        {"name": "two\nlines"},
    ],
)
def test_schema_refuses_what_is_wrong(wrong: dict[str, Any]) -> None:
    validator = jsonschema.Draft202012Validator(shipped(SCHEMA_FILE))
    assert list(validator.iter_errors(wrong))
