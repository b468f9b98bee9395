"""Words for the fields of a scenario on the axes of pictures."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from typing import Any

from diagrams.scenario.fields.field_list import list_fields
from diagrams.scenario.fields.shipped import scenario_schema


@cache
def _units() -> dict[str, str]:
    return {field.path: field.unit for field in list_fields(scenario_schema())}


def field_label(path: str, base: Mapping[str, Any] | None = None) -> str:
    """Describes a field by words and unit, for example ``speed of cart (m/s)``.

    Args:
        path: Dotted path of the field.
        base: Fields of the scenario, which state the names of obstacles.

    Returns:
        The text; if the field is not a field of scenarios, its path.
    """
    parts, robot = path.split("."), ""
    if parts[0] == "robots" and len(parts) > 2:
        robot, parts = parts[1], parts[2:]
    elif parts[0] == "sources" and len(parts) > 2:
        robot, parts = parts[1], parts[2:] if parts[2] == "sound" else parts[1:]
        parts = parts if parts[0] == "sound" else ["source", *parts[1:]]
    general = [
        "0" if part.isdigit() or (k == 1 and parts[0] == "obstacles") else part
        for k, part in enumerate(parts)
    ]
    depth = next(
        (k for k in range(len(parts), 0, -1) if ".".join(general[:k]) in _units()), 0
    )
    if not depth:
        return path
    unit = _units()[".".join(general[:depth])]
    owner, name, places = parts[: depth - 1], parts[depth - 1], parts[depth:]
    words = _without_unit(name, unit).replace("_", " ")
    if name == "waypoints_m" and len(places) == 2:
        words = f"{'xy'[int(places[1])]} of waypoint {int(places[0]) + 1}"
    elif name == "size_m" and len(places) == 1:
        words = ("length", "width", "height")[int(places[0])]
    elif name == "own_gains" and places:
        words = f"gain {places[0]}"
    elif places:
        words += f" [{', '.join(places)}]"
    of = " of ".join(filter(None, (_owner(owner, base or {}), robot)))
    text = f"{words} of {of}" if of else words
    return f"{text} ({unit})" if unit else text


def _owner(parts: list[str], base: Mapping[str, Any]) -> str:
    if not parts:
        return ""
    if parts[0] == "obstacles" and len(parts) > 1:
        if not parts[1].isdigit():
            return parts[1]
        listed = base.get("obstacles") or []
        number = int(parts[1])
        entry = listed[number] if number < len(listed) else {}
        return str(entry.get("name") or f"obstacle {number + 1}")
    if parts[0] == "laws" and len(parts) > 1:
        return f"law {parts[1]}"
    return parts[-1].replace("_", " ")


def _without_unit(name: str, unit: str) -> str:
    ending = "_" + re.sub(r"\W+", "_", unit.replace("^", "")).strip("_").lower()
    return name.replace(ending, "", 1) if unit and ending in name else name
