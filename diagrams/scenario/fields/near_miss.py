"""Suggests names that are similar to a mistyped name."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from diagrams.scenario.fields.schema_walk import at_place, leaf_paths
from diagrams.scenario.suggestions import did_you_mean

#: Groups of synonyms with different letters; scenarios use one word of each group.
_SAME_THING = (
    ("position", "location", "place", "pose", "center", "centre", "xy", "waypoints"),
    ("size", "dimensions", "extent", "extents"),
    ("speed", "velocity"),
    ("heading", "angle", "yaw", "orientation", "theta"),
)

#: Groups whose fields users change most.
_USUAL = ("source", "robot", "obstacles", "attraction", "room", "microphones")


def near_field(schema: Mapping[str, Any], place: Sequence[str]) -> str:
    """Suggests an existing field if a user has written an unknown field.

    The function suggests the first of these fields that exists:

    1. a field in the same group with this name and a unit
    2. a field in the same group with the same meaning
    3. a field in a lower group with this name, with or without a unit
    4. a field anywhere with this name, with or without a unit
    5. a field in the same group with a similar name

    Args:
        schema: JSON Schema of the whole data.
        place: Parts of the path of the unknown field.

    Returns:
        A text for the error message, empty if there is no such field.
    """
    *parents, last = place
    siblings = list(at_place(schema, parents))
    return (
        _meant(each for each in siblings if each.startswith(f"{last}_"))
        or _of_that_meaning(last, siblings)
        or _elsewhere(schema, place)
        or did_you_mean(last, siblings)
    )


def fields_called(schema: Mapping[str, Any], name: str) -> list[str]:
    """Returns the paths of all fields with a name, with or without a unit.

    Fields of the run come first, then those of the source, the robot and obstacles.
    """
    found = [
        path
        for path in leaf_paths(schema)
        if path[-1] == name or path[-1].startswith(f"{name}_")
    ]

    def rank(path: Sequence[str]) -> tuple[int, int]:
        usual = _USUAL.index(path[0]) if path[0] in _USUAL else len(_USUAL)
        return 0 if len(path) == 1 else 1 + usual, len(path)

    return [".".join(path) for path in sorted(found, key=rank)]


def _meant(names: Iterable[str]) -> str:
    found = next(iter(names), "")
    return f" (did you mean {found!r}?)" if found else ""


def _of_that_meaning(name: str, siblings: Iterable[str]) -> str:
    """Suggests a field of the same group with the same meaning, whatever its unit."""

    def told(field: str) -> str:
        return field.casefold().partition("_")[0]

    alike = next((words for words in _SAME_THING if told(name) in words), ())
    return _meant(field for field in siblings if told(field) in alike)


def _elsewhere(schema: Mapping[str, Any], place: Sequence[str]) -> str:
    """Suggests a field elsewhere with this name, or with this name and a unit."""
    *parents, name = place
    below = [
        (*parents, *path)
        for path in leaf_paths(schema, parents)
        if path[-1] == name or path[-1].startswith(f"{name}_")
    ]
    if parents and below:
        return _meant([min(map(".".join, below), key=len)])
    return _meant(fields_called(schema, name))
