"""The JSON Schema of a sweep's file, made from the model.

It is shipped as ``sweep.schema.json``, which ``make schemas`` writes anew.
"""

from __future__ import annotations

from typing import Any

from analysis.batches.plan import SweepPlan
from tools.scenario_schema import tidied


def make_sweep_schema() -> dict[str, Any]:
    """Types, ranges, defaults and meanings of the fields of a sweep."""
    schema = SweepPlan.model_json_schema()
    del schema["properties"]["folder"]  # it is that of the file
    return tidied(schema, "A sweep of phonotaxis")
