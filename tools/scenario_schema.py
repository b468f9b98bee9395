"""The JSON Schema of a scenario, made from the models.

It is shipped as ``scenario.schema.json``, which ``make schemas`` writes anew.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from typing import Any

from pydantic import Field

from diagrams.scenario.participants import (
    Follower,
    OdorSearcher,
    Router,
    SoundSearcher,
    SourceParameters,
)
from diagrams.scenario.run_parameters import RunParameters
from diagrams.scenario.scenario import Name
from diagrams.scenario.shorthand import ROBOT_FIELDS
from systems.base.carrier_parameters import SourceRobotParameters
from systems.framework.meanings import meanings
from systems.framework.parameters import Parameters, Point
from systems.laws.catalog import LAWS
from systems.routes.parameters import RouteParameters
from systems.sound.parameters import SoundParameters

#: Ends of names, the longest first, and units.
_UNITS = {
    "at_2_m": "",
    "n_s_m": "N s/m",
    "m_s2": "m/s^2",
    "rad_s2": "rad/s^2",
    "db_at_1m": "dB",
    "n_m": "N/m",
    "m_s": "m/s",
    "s_m": "s/m",
    "rad_s": "rad/s",
    "per_h": "1/h",
    "per_s": "1/s",
    "deg": "deg",
    "rad": "rad",
    "dbm": "dBm",
    "bits": "bits",
    "m3": "m^3",
    "hz": "Hz",
    "db": "dB",
    "pa": "Pa",
    "kg": "kg",
    "m": "m",
    "s": "s",
    "n": "N",
    "j": "J",
    "v": "V",
    "c": "deg C",
}


class _Robot(Follower, Router, OdorSearcher, SoundSearcher):
    """One robot; its law decides which of these fields it has."""

    route: RouteParameters | None = None  # type: ignore[assignment]
    """Goal and planner of a robot that drives on a planned route."""


class _Source(SourceRobotParameters):
    """One source: the leader that carries it."""

    body: bool = True
    """Whether the source has a body that robots can hit and see; false: the source is
    only a point, and a sound."""


class _File(_Robot, RunParameters):
    """A run. The fields of a robot apply to all robots that do not set them."""

    robots: dict[Name, _Robot] = Field(default={})
    """Robots by name, each with the fields that differ from those of the scenario;
    empty: one robot, named ``robot``, with the fields of the scenario."""
    sources: dict[Name, SourceParameters] = Field(default={})
    """Sources by name, each with the fields that differ from ``source`` and ``sound``;
    empty: one source, named ``source``. A source that no robot follows is an
    interferer."""
    goal_m: Point | None = None
    """Goal of the control point P: a point in W, m, in place of the source. It stands
    for a source at rest without a body (``source.body: false``), ``hearing:
    ideal_always``, and the follow distance 0. With a law that drives on a route, it is
    ``route.goal_m``."""
    source: _Source = _Source()
    sound: SoundParameters = SoundParameters()


def make_schema() -> dict[str, Any]:
    """The schema of scenario files: types, ranges, defaults, meanings and units.

    Returns:
        The schema; see ``tidied``. The keyword ``robots`` of a field of robots has the
        kinds of robots that have this field. The keyword ``same_fields_as`` names a
        group with the same model.
    """
    schema = _File.model_json_schema()
    for node in (schema, schema["$defs"]["_Robot"]):
        named = [{"const": law.name, "description": law.title} for law in LAWS.values()]
        node["properties"]["law"]["anyOf"] = [*named, {"pattern": ":"}]
        node["properties"]["loudspeaker"]["same_fields_as"] = "sound"
        for name, kinds in ROBOT_FIELDS.items():
            node["properties"][name]["robots"] = list(kinds)
    return tidied(schema, "A scenario of phonotaxis")


def tidied(schema: dict[str, Any], title: str) -> dict[str, Any]:
    """A schema for people, made from that of a model.

    Args:
        schema: As pydantic makes it; it is changed.
        title: Its title.

    Returns:
        JSON Schema of 2020-12, with a keyword ``unit`` of our own.
    """
    definitions = schema.pop("$defs", {})
    models = {model.__name__: model for model in _models(Parameters)}
    for name, each in {schema["title"]: schema, **definitions}.items():
        _tidy(each, definitions, meanings(models[name]))
        del each["title"]
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": title,
        **schema,
        "$defs": definitions,
    }


def schema_file_text(schema: dict[str, Any]) -> str:
    """The text of the file that a schema is shipped in."""
    return json.dumps(schema, indent=1) + "\n"


def unit_of(name: str, meaning: str) -> str:
    """Unit of a number: what its name ends in, else what its meaning says.

    Args:
        name: Of the field.
        meaning: Its docstring.

    Returns:
        SI, deg or dB; empty: a plain number.
    """
    for end, unit in _UNITS.items():
        if name.endswith(f"_{end}"):
            return unit
    said = re.search(r", (1/s|m/s|s|\(N/m\)\^2/\(m\^2 s\))(?=[ .:;,])", meaning)
    return said[1] if said else ""


def _models(base: type[Parameters]) -> Iterator[type[Parameters]]:
    for model in base.__subclasses__():
        yield model
        yield from _models(model)


def _tidy(
    model: dict[str, Any], definitions: Mapping[str, Any], told: Mapping[str, str]
) -> None:
    """Leaves out what says nothing, and says meanings and units."""
    model["description"] = _one_line(model.get("description", ""))
    for name, field in model.get("properties", {}).items():
        field.pop("title", None)
        meaning = _one_line(told.get(name, ""))
        if meaning:
            field["description"] = meaning
        if _is_numeric(field) and (unit := unit_of(name, meaning)):
            field["unit"] = unit
        if "$ref" in field:
            group = definitions[field["$ref"].rpartition("/")[2]]["properties"]
            own = {key: each.get("default") for key, each in group.items()}
            if field.get("default") == own:
                del field["default"]


def _one_line(text: str) -> str:
    return " ".join(text.split()).replace("``", "`")


def _is_numeric(node: Mapping[str, Any]) -> bool:
    """Whether it is a number, or has only numbers in it."""
    parts = [*node.get("anyOf", ()), *node.get("prefixItems", ())]
    if "items" in node:
        parts.append(node["items"])
    if parts:
        return any(_is_numeric(part) for part in parts)
    return node.get("type") in ("number", "integer")
