"""A first check of a scenario's fields: names, types and ranges, by the schema alone.

It finds what pydantic's models would, in the same words, without loading what
simulates; what takes several fields to judge is left to the models.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic_core import SchemaValidator, ValidationError, core_schema

from diagrams.fields.explain import explain
from diagrams.fields.near_miss import unknown_law
from diagrams.fields.shipped import known_laws, scenario_schema
from systems.framework.input_error import InputError

__all__ = ["check_fields", "check_structure"]

_BOUNDS = {
    "minimum": "ge",
    "maximum": "le",
    "exclusiveMinimum": "gt",
    "exclusiveMaximum": "lt",
}
#: As ``Parameters`` has it.
_CONFIG = core_schema.CoreConfig(
    strict=True, allow_inf_nan=False, extra_fields_behavior="forbid"
)


def check_fields(data: Mapping[str, Any]) -> None:
    """Checks each field of a scenario by itself.

    Args:
        data: Plain values.

    Raises:
        InputError: Fields that there are not, or values that are none of theirs; has
            all of them.
    """
    faults = []
    try:
        check_structure(data, scenario_schema(), "a scenario")
    except InputError as error:
        faults.append(error)
    robots = data.get("robots")
    places = {"": data}
    if isinstance(robots, Mapping):
        places |= {f"robots.{name}.": own for name, own in robots.items()}
    for place, fields in places.items():
        law = fields.get("law") if isinstance(fields, Mapping) else None
        if isinstance(law, str) and law and ":" not in law and law not in known_laws():
            faults.append(unknown_law(law, known_laws(), f"{place}law"))
    if faults:
        raise InputError.joined(faults)


def check_structure(data: Any, schema: Mapping[str, Any], what: str) -> None:
    """Checks plain values by a JSON Schema that pydantic made.

    Args:
        data: Plain values.
        schema: Of what they are to be.
        what: What that is to a user, as 'a scenario'.

    Raises:
        InputError: Single fields are wrong; has all of them.
    """
    definitions = [
        {**_of_node(node), "ref": name}
        for name, node in schema.get("$defs", {}).items()
    ]
    whole = core_schema.definitions_schema(_of_node(schema), definitions)  # type: ignore[arg-type]  # a copy with its name
    try:
        SchemaValidator(whole).validate_python(data)
    except ValidationError as error:
        raise explain(error, schema, what) from None


def _of_node(node: Mapping[str, Any]) -> core_schema.CoreSchema:
    if "$ref" in node:
        return core_schema.definition_reference_schema(node["$ref"].rpartition("/")[2])
    if "type" not in node and "anyOf" in node:
        found = [_of_node(each) for each in node["anyOf"] if each.get("type") != "null"]
        # What may be of several kinds has a validator of its own.
        one = found[0] if len(found) == 1 else core_schema.any_schema()
        return (
            core_schema.nullable_schema(one)
            if {"type": "null"} in node["anyOf"]
            else one
        )
    if "enum" in node:
        return core_schema.literal_schema(node["enum"])
    return _of_type(node) if "type" in node else core_schema.any_schema()


def _of_type(node: Mapping[str, Any]) -> core_schema.CoreSchema:
    bounds = {ours: node[key] for key, ours in _BOUNDS.items() if key in node}
    match node["type"]:
        case "number":
            return core_schema.float_schema(**bounds, strict=True, allow_inf_nan=False)
        case "integer":
            return core_schema.int_schema(**bounds, strict=True)
        case "boolean":
            return core_schema.bool_schema(strict=True)
        case "string":
            return core_schema.str_schema(
                pattern=node.get("pattern"), min_length=node.get("minLength")
            )
        case "array":
            return _of_array(node)
    return _of_object(node)


def _of_array(node: Mapping[str, Any]) -> core_schema.CoreSchema:
    # YAML knows lists only.
    if "prefixItems" in node:
        return core_schema.tuple_schema(
            [*map(_of_node, node["prefixItems"])], strict=False
        )
    return core_schema.tuple_schema(
        [_of_node(node["items"])],
        variadic_item_index=0,
        min_length=node.get("minItems"),
        max_length=node.get("maxItems"),
        strict=False,
    )


def _of_object(node: Mapping[str, Any]) -> core_schema.CoreSchema:
    if "properties" not in node:
        named = node.get("patternProperties") or {".*": node["additionalProperties"]}
        (pattern, value), *_ = named.items()
        return core_schema.dict_schema(
            core_schema.str_schema(pattern=pattern),
            _of_node(value) if value is not True else core_schema.any_schema(),
            max_length=node.get("maxProperties"),
            strict=True,
        )
    fields = {
        name: core_schema.typed_dict_field(_of_node(each), required=False)
        for name, each in node["properties"].items()
    }
    return core_schema.typed_dict_schema(fields, config=_CONFIG)
