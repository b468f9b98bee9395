"""The range of every number of a scenario, by the kind of quantity that it is."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from pydantic.json_schema import models_json_schema

from diagrams.scenario import participants
from diagrams.scenario.run_parameters import RunParameters
from systems.laws.catalog import LAWS

#: What the unit at the end of a field's name allows, longest ending first. A robot on
#: a floor stays within a kilometer, a run within a day; nothing that divides is 0.
KINDS = {
    "_sound_speed_m_s": (50.0, 1e4),
    "_position_m": (-1e3, 1e3),
    "_positions_m": (-1e3, 1e3),
    "_microphones_m": (-1e3, 1e3),
    "_waypoints_m": (-1e3, 1e3),
    "_polygon_m": (-1e3, 1e3),
    "_wall_m": (-1e3, 1e3),
    "_corner_m": (-1e3, 1e3),
    "_goal_m": (-1e3, 1e3),
    "_origin_m": (-1e3, 1e3),
    "_clearance_m": (0.0, 1e3),
    "_start_s": (0.0, 86_400.0),
    "_start_time_s": (0.0, 86_400.0),
    "_n_s_m": (1e-9, 1e6),
    "_m_s2": (1e-3, 1e6),
    "_rad_s": (1e-9, 1e6),
    "_s_m": (1e-9, 1e6),
    "_n_m": (1e-9, 1e6),
    "_m_s": (1e-3, 100.0),
    "_deg": (-3600.0, 3600.0),
    "_hz": (1.0, 1e6),
    "_kg": (1e-3, 1e4),
    "_pa": (1e-9, 1e6),
    "_j": (1e-9, 1e6),
    "_n": (1e-9, 1e6),
    "_v": (1e-9, 1e6),
    "_m": (1e-9, 1e3),
    "_s": (1e-9, 86_400.0),
    # Weights of a sum, which may leave a part out, and what is held against it.
    "_gain": (0.0, 1e6),
    "_threshold": (0.0, 1e6),
}


def schemas() -> dict[str, dict[str, Any]]:
    """Schema of every field of the scenario's tree, as `Model.field`.

    It is that of what a field holds, which may be given in a shorter form.
    """
    models = (
        RunParameters,
        participants.SourceParameters,
        *participants.KINDS.values(),
        *(law.gains for law in LAWS.values() if law.gains is not None),
    )
    pairs: Any = [(model, "validation") for model in models]
    _, schema = models_json_schema(pairs)
    return {
        f"{model}.{field}": schema
        for model, whole in schema["$defs"].items()
        for field, schema in whole.get("properties", {}).items()
    }


def numbers(schema: dict[str, Any]) -> Iterator[tuple[float, float]]:
    """Least and greatest value of every number in a field."""
    if schema.get("type") in ("number", "integer"):
        yield limits(schema)
    for part in (*schema.get("anyOf", ()), *schema.get("prefixItems", ())):
        yield from numbers(part)
    if isinstance(schema.get("items"), dict):
        yield from numbers(schema["items"])


def limits(schema: dict[str, Any]) -> tuple[float, float]:
    """Least and greatest value that a number may have."""
    whole = schema["type"] == "integer"
    least = schema.get("minimum", -math.inf)
    greatest = schema.get("maximum", math.inf)
    if "exclusiveMinimum" in schema:
        above = schema["exclusiveMinimum"]
        least = above + 1 if whole else math.nextafter(above, math.inf)
    if "exclusiveMaximum" in schema:
        below = schema["exclusiveMaximum"]
        greatest = below - 1 if whole else math.nextafter(below, -math.inf)
    return least, greatest


NUMBERS = {name: set(numbers(schema)) for name, schema in schemas().items()}


def test_every_number_has_limits():
    """No field takes infinity, and none is without a largest value."""
    open_ended = {
        name
        for name, pairs in NUMBERS.items()
        if not all(math.isfinite(end) for pair in pairs for end in pair)
    }
    assert open_ended == set()


def test_numbers_stay_within_what_their_unit_allows():
    """They may be narrower, and a few that only add something may be 0."""
    checked, outside = 0, {}
    for name, pairs in NUMBERS.items():
        field = "_" + name.partition(".")[2]
        kinds = (ends for kind, ends in KINDS.items() if field.endswith(kind))
        allowed = next(kinds, None)
        if pairs and allowed is not None:
            checked += 1
            least, greatest = min(allowed[0], 0.0), allowed[1]
            if not all(least <= a and b <= greatest for a, b in pairs):
                outside[name] = pairs
    assert checked > 100
    assert not outside
