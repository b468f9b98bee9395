"""What fields a scenario has: their list, what is most like a name, faults.

All of it reads the schema that is shipped, so that nothing is loaded that simulates.
"""

from typing import TYPE_CHECKING

from systems.framework.lazy import lazy_exports

if TYPE_CHECKING:
    from diagrams.fields.explain import explain, single_faults
    from diagrams.fields.field_list import Field, find_fields, list_fields
    from diagrams.fields.joining import begins_anew, joined
    from diagrams.fields.near_miss import did_you_mean, near_field, unknown_law
    from diagrams.fields.shipped import known_laws, scenario_schema, schema_text
else:
    __getattr__, __dir__ = lazy_exports(__name__)

__all__ = [
    "Field",
    "begins_anew",
    "did_you_mean",
    "explain",
    "find_fields",
    "joined",
    "known_laws",
    "list_fields",
    "near_field",
    "scenario_schema",
    "schema_text",
    "single_faults",
    "unknown_law",
]
