"""Changes to a tree of plain values."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def begins_anew(changes: Mapping[str, Any]) -> bool:
    """Whether changes to a group choose its preset, so that the rest is forgotten.

    Args:
        changes: Plain values by field.

    Returns:
        False of a group of robots or sources one of which bears that name.
    """
    return isinstance(changes.get("preset"), str)


def joined(base: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """A tree of plain values, with some of its leaves changed.

    Args:
        base: The tree.
        changes: A tree of the leaves to change, or to add; a group that chooses a
            preset is that of the changes alone.

    Returns:
        A new tree; neither argument is changed.
    """
    result = {} if begins_anew(changes) else dict(base)
    for key, value in changes.items():
        before = result.get(key)
        if isinstance(value, Mapping) and isinstance(before, Mapping):
            result[key] = joined(before, value)
        else:
            result[key] = value
    return result
