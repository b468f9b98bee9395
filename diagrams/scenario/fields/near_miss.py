"""What a mistyped name is most like."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from difflib import get_close_matches
from typing import Any

from diagrams.scenario.fields.schema_walk import at_place, leaf_paths
from systems.framework.input_error import InputError

#: Words for one thing, which letters do not show: scenarios call it by one of them.
_SAME_THING = (
    ("position", "location", "place", "pose", "centre", "center", "xy", "waypoints"),
    ("size", "dimensions", "extent", "extents"),
    ("speed", "velocity"),
    ("heading", "angle", "yaw", "orientation", "theta"),
)


def did_you_mean(name: str, known: Iterable[str], most: int = 1) -> str:
    """The end of a message that names what is most like a name.

    Args:
        name: What was given.
        known: What could be.
        most: So many are named at most.

    Returns:
        Empty where nothing is like it.
    """
    by_folded = {each.casefold(): each for each in known}
    near = get_close_matches(name.casefold(), by_folded, n=most)
    if not near:
        return ""
    return f" (did you mean {' or '.join(repr(by_folded[each]) for each in near)}?)"


def near_field(schema: Mapping[str, Any], place: Sequence[str]) -> str:
    """``did_you_mean`` of a field that is none.

    Args:
        schema: JSON Schema of the whole.
        place: Parts of its path.

    Returns:
        A field at the same place, by its letters or by what it tells; without one, a
        field of that name below that place, or else anywhere.
    """
    *parents, last = place
    siblings = at_place(schema, parents)
    return (
        did_you_mean(last, siblings)
        or _of_that_meaning(last, siblings)
        or _elsewhere(schema, place)
    )


def unknown_law(name: str, known: Collection[str]) -> InputError:
    """The error of a law that there is not.

    Args:
        name: What was given.
        known: What could be.

    Returns:
        The error, to be raised.
    """
    near = did_you_mean(name, known)
    return InputError(
        "",  # the model that has the field knows where it is
        f"{name!r} is not known; use {', '.join(known)}, or file.py:Name{near}",
    )


def _of_that_meaning(name: str, siblings: Iterable[str]) -> str:
    """A sibling that tells the same in another word: the unit is no part of it."""

    def told(field: str) -> str:
        return field.casefold().partition("_")[0]

    alike = next((words for words in _SAME_THING if told(name) in words), ())
    found = next((field for field in siblings if told(field) in alike), "")
    return f" (did you mean {found!r}?)" if found else ""


def _elsewhere(schema: Mapping[str, Any], place: Sequence[str]) -> str:
    """One of that name, or of that name and a unit: those are often left out."""
    *parents, name = place
    below = ((*parents, *path) for path in leaf_paths(schema, parents))
    for paths in (list(below), list(leaf_paths(schema))):
        named = [path for path in paths if path[-1] == name]
        found = named or [path for path in paths if path[-1].startswith(f"{name}_")]
        if found:
            return f" (did you mean {min(map('.'.join, found), key=len)!r}?)"
    return ""
