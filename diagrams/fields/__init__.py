"""What fields a scenario has: their list, what is most like a name, a first check.

All of it reads the schema that is shipped, so that nothing is loaded that simulates.
"""

from diagrams.fields.explain import explain
from diagrams.fields.field_list import Field, find_fields, list_fields
from diagrams.fields.joining import begins_anew, joined
from diagrams.fields.near_miss import did_you_mean, near_field, unknown_law
from diagrams.fields.shipped import known_laws, scenario_schema, schema_text
from diagrams.fields.structure import check_fields, check_structure

__all__ = [
    "Field",
    "begins_anew",
    "check_fields",
    "check_structure",
    "did_you_mean",
    "explain",
    "find_fields",
    "joined",
    "known_laws",
    "list_fields",
    "near_field",
    "scenario_schema",
    "schema_text",
    "unknown_law",
]
