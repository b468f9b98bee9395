"""Finds fields and paths in the JSON Schema of a tree of parameters."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

Schema = Mapping[str, Any]


def resolved(schema: Schema, node: Schema) -> Schema:
    """Replaces the reference in a node of a JSON Schema by the referenced node.

    The result also has the other entries of ``node``. Without a reference, it is
    ``node`` itself. ``schema`` is the whole schema.
    """
    if "$ref" not in node:
        return node
    return {**schema["$defs"][node["$ref"].rpartition("/")[2]], **node}


def options(schema: Schema, node: Schema) -> list[Schema]:
    """Returns the alternatives that a node of a JSON Schema permits, except null.

    References are replaced by the referenced nodes. ``schema`` is the whole schema.
    """
    node = resolved(schema, node)
    several = node.get("anyOf", [node]) if "type" not in node else [node]
    return [resolved(schema, each) for each in several if each.get("type") != "null"]


def at_place(schema: Schema, place: Sequence[str]) -> Schema:
    """Returns the schemas of the fields of the group at a given path.

    Args:
        schema: The whole JSON Schema.
        place: Parts of the path: names of fields, indices of list elements, and names
            of robots and sources.

    Returns:
        Schema of each field, by name of the field. The mapping is empty if the group
        has no fields.
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
    """Yields the paths of all fields and groups below a place in a JSON Schema.

    In a path, 0 represents any element of a list.

    Args:
        schema: The whole schema.
        place: Path of the group to start from, see ``at_place``. Empty: the whole
            schema.

    Yields:
        Paths relative to ``place``, as tuples of their parts.
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
