"""Ways through the JSON Schema of a tree of parameters."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

Schema = Mapping[str, Any]


def resolved(schema: Schema, node: Schema) -> Schema:
    """Follows the reference of a node.

    Args:
        schema: The whole.
        node: A part of it.

    Returns:
        What it refers to, with what it says itself; without a reference the node.
    """
    if "$ref" not in node:
        return node
    return {**schema["$defs"][node["$ref"].rpartition("/")[2]], **node}


def options(schema: Schema, node: Schema) -> list[Schema]:
    """What a node may be.

    Args:
        schema: The whole.
        node: A part of it.

    Returns:
        Each but null, references resolved.
    """
    node = resolved(schema, node)
    several = node.get("anyOf", [node]) if "type" not in node else [node]
    return [resolved(schema, each) for each in several if each.get("type") != "null"]


def at_place(schema: Schema, place: Sequence[str]) -> Schema:
    """Fields below a place.

    Args:
        schema: The whole.
        place: Names of fields, numbers of a list's elements, names of participants.

    Returns:
        Their schemas by name; empty where there are none.
    """
    node: Schema = schema
    for part in place:
        node = next(
            (below for each in options(schema, node) for below in _below(each, part)),
            {},
        )
    found: dict[str, Any] = {}
    for each in options(schema, node):
        found |= each.get("properties", {})
    return found


def _below(node: Schema, part: str) -> Iterator[Schema]:
    if part in node.get("properties", {}):
        yield node["properties"][part]
    elif "items" in node and part.isdigit():
        yield node["items"]
    else:
        yield from node.get("patternProperties", {}).values()


def leaf_paths(schema: Schema, place: Sequence[str] = ()) -> Iterator[tuple[str, ...]]:
    """Paths of all fields, groups included, of lists those of the first element.

    Args:
        schema: The whole.
        place: Below which, as of ``at_place``; none: below the top.

    Yields:
        Each from there.
    """
    yield from _leaf_paths(schema, {"properties": at_place(schema, place)}, ())


def _leaf_paths(
    schema: Schema, node: Schema, above: tuple[str, ...]
) -> Iterator[tuple[str, ...]]:
    for each in options(schema, node):
        for name, field in each.get("properties", {}).items():
            yield (*above, name)
            yield from _leaf_paths(schema, field, (*above, name))
        if "items" in each:
            yield from _leaf_paths(schema, each["items"], (*above, "0"))
