"""Suggests names that are similar to a mistyped name."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from diagrams.scenario.fields.schema_walk import at_place, leaf_paths
from diagrams.scenario.suggestions import did_you_mean

#: Groups of synonyms with different letters; scenarios use one word of each group.
_SAME_THING = (
    ("position", "location", "place", "pose", "center", "center", "xy", "waypoints"),
    ("size", "dimensions", "extent", "extents"),
    ("speed", "velocity"),
    ("heading", "angle", "yaw", "orientation", "theta"),
)


def near_field(schema: Mapping[str, Any], place: Sequence[str]) -> str:
    """Suggests an existing field if a user has written an unknown field.

    The function suggests the first of these fields that exists:

    1. a field in the same group with a similar name
    2. a field in the same group with the same meaning
    3. a field in a lower group with the same name
    4. a field anywhere with the same name

    Args:
        schema: JSON Schema of the whole data.
        place: Parts of the path of the unknown field.

    Returns:
        A text for the error message, empty if there is no such field.
    """
    *parents, last = place
    siblings = at_place(schema, parents)
    return (
        did_you_mean(last, siblings)
        or _of_that_meaning(last, siblings)
        or _elsewhere(schema, place)
    )


def _of_that_meaning(name: str, siblings: Iterable[str]) -> str:
    """Suggests a field of the same group with the same meaning, whatever its unit."""

    def told(field: str) -> str:
        return field.casefold().partition("_")[0]

    alike = next((words for words in _SAME_THING if told(name) in words), ())
    found = next((field for field in siblings if told(field) in alike), "")
    return f" (did you mean {found!r}?)" if found else ""


def _elsewhere(schema: Mapping[str, Any], place: Sequence[str]) -> str:
    """Suggests a field elsewhere with this name, or with this name and a unit."""
    *parents, name = place
    below = ((*parents, *path) for path in leaf_paths(schema, parents))
    for paths in (list(below), list(leaf_paths(schema))):
        named = [path for path in paths if path[-1] == name]
        found = named or [path for path in paths if path[-1].startswith(f"{name}_")]
        if found:
            return f" (did you mean {min(map('.'.join, found), key=len)!r}?)"
    return ""
