"""Navigates the JSON Schema of a tree of parameters."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

Schema = Mapping[str, Any]


def resolved(schema: Schema, node: Schema) -> Schema:
    """Follows the reference of a node.

    Args:
        schema: The whole schema.
        node: A part of it.

    Returns:
        The referenced node, extended by the entries of the node itself. A node without
        a reference is returned as it is.
    """
    if "$ref" not in node:
        return node
    return {**schema["$defs"][node["$ref"].rpartition("/")[2]], **node}


def options(schema: Schema, node: Schema) -> list[Schema]:
    """Returns the alternatives of a node.

    Args:
        schema: The whole schema.
        node: A part of it.

    Returns:
        All alternatives except null, with references resolved.
    """
    node = resolved(schema, node)
    several = node.get("anyOf", [node]) if "type" not in node else [node]
    return [resolved(schema, each) for each in several if each.get("type") != "null"]


def at_place(schema: Schema, place: Sequence[str]) -> Schema:
    """Returns the fields below a place.

    Args:
        schema: The whole schema.
        place: Names of fields, indices of list elements, names of robots and sources.

    Returns:
        Schemas of the fields by name; empty if there are none.
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
    """Yields the paths of all fields and groups; 0 is any element of a list.

    Args:
        schema: The whole schema.
        place: Start of the walk, see ``at_place``; empty: the top.

    Yields:
        Paths relative to the place.
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
