"""The list of all fields of a scenario, with unit, default, range and meaning."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any

from diagrams.scenario.fields.schema_walk import options, resolved
from diagrams.scenario.suggestions import did_you_mean
from systems.framework.input_error import InputError

_KINDS = {
    "number": "number",
    "integer": "whole number",
    "boolean": "true or false",
    "string": "text",
    "object": "group",
    "null": "null",
}


@dataclass(frozen=True)
class Field:
    """A field of a scenario."""

    path: str
    """Dotted path, as for ``--set``. In a path, 0 represents any element of a list, and
    NAME any name.
    """
    kind: str
    """Type of the values, in words."""
    unit: str
    """Unit of a number; empty: none."""
    default: Any
    """Plain value of the default; None for a group that is always present."""
    range: str
    """Legal values; empty: all values of the kind."""
    meaning: str
    """Description of the field."""
    robots: tuple[str, ...] = ()
    """Kinds of robots that have the field; empty: a field of the run."""


def list_fields(schema: Mapping[str, Any]) -> Iterator[Field]:
    """Lists all fields of a scenario, in the order of its JSON Schema.

    Some fields are groups of further fields. A group comes before its own fields.
    """
    yield from _fields(schema, schema, "", None, ())


def fields_of_law(fields: Iterable[Field], law: str, kind: str) -> list[Field]:
    """Returns the fields of a robot that runs a certain control law.

    The result omits the gains of other laws and the fields of the run.

    Args:
        fields: The fields to select from.
        law: Name of the law.
        kind: Kind of the robots that run the law.

    Returns:
        The fields of robots of this kind.
    """
    return [
        field
        for field in fields
        if kind in field.robots
        and (not field.path.startswith("laws.") or field.path.split(".")[1] == law)
    ]


def find_fields(
    schema: Mapping[str, Any], pattern: str, own: Iterable[Field] = ()
) -> list[Field]:
    """Finds fields of a scenario by their path or meaning.

    Fields with a matching path come first. Case does not matter.

    Args:
        schema: JSON Schema of a scenario.
        pattern: A part of the path or meaning. A pattern with a wildcard (``*``, ``?``
            or ``[...]``) must match the whole path or a part of the meaning. An empty
            pattern matches all fields.
        own: Further fields, which precede those of the schema.

    Returns:
        One or more fields.

    Raises:
        InputError: No field matches.
    """
    every, wanted = [*own, *list_fields(schema)], pattern.casefold()
    if any(each in wanted for each in "*?["):
        by_path = [f for f in every if fnmatchcase(f.path.casefold(), wanted)]
    else:
        by_path = [f for f in every if wanted in f.path.casefold()]
    by_meaning = [
        f
        for f in every
        if f not in by_path and fnmatchcase(f.meaning.casefold(), f"*{wanted}*")
    ]
    if found := by_path + by_meaning:
        return found
    last = [f.path.rpartition(".")[2] for f in every]
    hint = did_you_mean(pattern, [*last, *(f.path for f in every)], most=3)
    raise InputError(
        "pattern",
        f"{pattern!r} is in no field's path or meaning{hint}; 'phonotaxis "
        "fields' lists all fields",
    )


def _fields(
    schema: Mapping[str, Any],
    node: Mapping[str, Any],
    above: str,
    defaults: Any,
    robots: tuple[str, ...],
) -> Iterator[Field]:
    for name, field in node.get("properties", {}).items():
        if field.get("shared"):  # the group above also has this field
            continue
        # A group may override the defaults of its model.
        default = field.get("default")
        if isinstance(defaults, Mapping) and name in defaults:
            default = defaults[name]
        kinds = tuple(field.get("robots", robots))
        yield from _field(schema, field, f"{above}{name}", default, kinds)


def _field(
    schema: Mapping[str, Any],
    node: Mapping[str, Any],
    path: str,
    default: Any,
    robots: tuple[str, ...],
) -> Iterator[Field]:
    choices = options(schema, node)
    null = any(each.get("type") == "null" for each in node.get("anyOf", ()))
    groups = [each for each in choices if "properties" in each]
    yield Field(
        path=path,
        kind=" or ".join([*map(_kind, choices), *(["null"] if null else [])]),
        unit=node.get("unit", ""),
        default=None if groups and not null else default,
        range=" or ".join(filter(None, map(_range, choices))),
        meaning=node.get("description") or _meaning(schema, node),
        robots=robots,
    )
    if "same_fields_as" in node:
        return
    for each in groups:
        yield from _fields(schema, each, f"{path}.", default, robots)
    for each in choices:
        if "properties" in (element := resolved(schema, each.get("items", {}))):
            yield from _fields(schema, element, f"{path}.0.", None, robots)
        for changes in each.get("patternProperties", {}).values():
            named = resolved(schema, changes)
            what = f"{', '.join(named['properties'])}: see these fields of a scenario"
            yield Field(f"{path}.NAME", "group", "", None, "", what)


def _meaning(schema: Mapping[str, Any], node: Mapping[str, Any]) -> str:
    """The first description among the options of a node and their list elements."""
    found = ""
    for each in options(schema, node):
        element = resolved(schema, each.get("items", {}))
        found = found or each.get("description", "") or element.get("description", "")
    return found


def _kind(node: Mapping[str, Any]) -> str:
    if "const" in node:
        return str(node["const"])
    if "enum" in node:
        return " or ".join(node["enum"])
    if "prefixItems" in node:
        return f"[{', '.join(map(_kind, node['prefixItems']))}]"
    if "items" in node:
        element = node["items"]
        return f"list of {'groups' if '$ref' in element else _kind(element)}"
    return _KINDS[node["type"]]


def _range(node: Mapping[str, Any]) -> str:
    inner = node.get("items") or next(iter(node.get("prefixItems", ())), None)
    if inner:
        most = f"at most {node['maxItems']}" if "maxItems" in node else ""
        many = most if "prefixItems" not in node else ""
        return ", each ".join(filter(None, [many, _range(inner)]))
    low, high = node.get("minimum"), node.get("maximum")
    above, below = node.get("exclusiveMinimum"), node.get("exclusiveMaximum")
    ends = [
        f"from {low:g}" if low is not None else "",
        f"above {above:g}" if above is not None else "",
        f"to {high:g}" if high is not None else "",
        f"below {below:g}" if below is not None else "",
    ]
    return " ".join(filter(None, ends))
