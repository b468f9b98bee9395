"""Applies changes to a tree of plain values."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def begins_anew(changes: Mapping[str, Any]) -> bool:
    """Whether changes to a group choose a preset, which clears the other fields.

    Args:
        changes: Plain values by field.

    Returns:
        True if the value of ``preset`` is a text. If ``preset`` is the name of a robot
        or source, its value is a mapping, and the result is False.
    """
    return isinstance(changes.get("preset"), str)


def joined(base: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Returns a tree of plain values with changes applied.

    Args:
        base: The tree.
        changes: A tree that contains only the leaves to change or add. Changes that
            choose a preset for a group replace the whole group.

    Returns:
        A new tree; the arguments stay unchanged.
    """
    result = {} if begins_anew(changes) else dict(base)
    for key, value in changes.items():
        before = result.get(key)
        listed: dict[str, Any] = {}
        if isinstance(before, list | tuple):
            listed = {str(k): each for k, each in enumerate(before)}
        if isinstance(value, Mapping) and isinstance(before, Mapping):
            result[key] = joined(before, value)
        elif isinstance(value, Mapping) and listed and value.keys() <= listed.keys():
            # Changes to some elements of a list, by index.
            result[key] = [*joined(listed, value).values()]
        else:
            result[key] = value
    return result
