"""Every field of a scenario is listed, with what the models say of it."""

from __future__ import annotations

import re
from typing import Any

import pytest

from diagrams import load_scenario
from diagrams.scenario.fields.field_list import find_fields, list_fields
from diagrams.scenario.fields.shipped import scenario_schema
from diagrams.scenario.scenario import Scenario
from systems.framework.input_error import InputError
from systems.sound.parameters import RoomParameters
from systems.world.parameters import ObstacleParameters
from tests.diagrams.scenario.kinds import KINDS

SCHEMA = scenario_schema()
FIELDS = {field.path: field for field in list_fields(SCHEMA)}


def leaves(value: Any, path: str = "") -> dict[str, Any]:
    """Plain values by path; robots, sources and lists count as values."""
    if not isinstance(value, dict) or not value:
        return {path: value}
    found: dict[str, Any] = {}
    for name, each in value.items():
        found |= leaves(each, f"{path}.{name}" if path else name)
    return found


@pytest.mark.parametrize("kind", KINDS)
def test_defaults_are_those_of_the_models(kind: str) -> None:
    scenario = Scenario.model_validate(KINDS[kind])
    defaults = leaves(scenario.model_dump(mode="json"))
    assert len(defaults) > 60
    stated = {
        path
        for path in defaults
        if path.partition(".")[0] in KINDS[kind] and path.partition(".")[0] != "route"
    }
    listed = {path: FIELDS[path].default for path in defaults}
    assert {path for path in listed if listed[path] != defaults[path]} <= stated


def test_defaults_of_groups_that_are_unset_are_those_of_the_models() -> None:
    for path, model in (("room", RoomParameters), ("obstacles.0", ObstacleParameters)):
        for name, value in model().model_dump(mode="json").items():
            assert FIELDS[f"{path}.{name}"].default == value


def test_every_field_has_a_meaning_and_what_is_no_plain_number_a_unit() -> None:
    """A unit that the name ends in stands in the docstring, too."""
    for field in FIELDS.values():
        assert len(field.meaning) > 3, field.path
        if field.unit:
            assert "number" in field.kind, field.path
            said = rf"(?<![\w/]){re.escape(field.unit)}(?![\w/^])"
            assert re.search(said, field.meaning), field.path
        elif "number" in field.kind:
            ends = r"_(m|s|m_s|m_s2|deg|rad|rad_s|hz|db|pa|kg|n|n_m|n_s_m|v|j)$"
            last = field.path.rpartition(".")[2]
            assert last == "ratio_at_2_m" or not re.search(ends, last), field.path


def test_ranges_are_those_that_the_models_hold_to() -> None:
    """What the list says is the least and the most is taken, and nothing beyond."""
    for name, field in (
        ("default", "wind.meander_intensity"),
        ("odor_search", "gas_sensors.mismatch"),
        ("sound_search", "compass.noise_deg"),
    ):
        low, high = re.findall(r"[-\d.e+]+", FIELDS[field].range)
        for value, step in ((low, -1e-3), (high, 1e-3)):
            load_scenario(name, [f"{field}={value}"])
            with pytest.raises(InputError, match=field):
                load_scenario(name, [f"{field}={float(value) + step}"])


@pytest.mark.parametrize(
    ("pattern", "found"),
    [
        ("reverberation_time", "room.reverberation_time_s"),
        ("ROOM.SIZE", "room.size_m"),
        ("obstacles.*", "obstacles.0.waypoints_m"),
        ("*_deg", "start.heading_deg"),
        ("sabine", "room.reverberation_time_s"),  # in its meaning alone
        ("robots.", "robots.NAME"),
    ],
)
def test_patterns(pattern: str, found: str) -> None:
    assert found in [field.path for field in find_fields(SCHEMA, pattern)]


def test_unknown_pattern_names_what_is_like_it() -> None:
    with pytest.raises(InputError, match="did you mean 'waypoints_m'"):
        find_fields(SCHEMA, "waypiont_m")
