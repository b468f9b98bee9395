"""Writes the JSON Schemas that are shipped anew: ``make schemas``."""

from __future__ import annotations

from analysis.batches.sweep_file import SWEEP_SCHEMA_FILE
from diagrams.scenario.fields.shipped import SCHEMA_FILE
from tools.scenario_schema import make_schema, schema_file_text
from tools.sweep_schema import make_sweep_schema


def main() -> None:
    """Writes both."""
    SCHEMA_FILE.write_text(schema_file_text(make_schema()), "utf-8")
    SWEEP_SCHEMA_FILE.write_text(schema_file_text(make_sweep_schema()), "utf-8")


if __name__ == "__main__":
    main()
