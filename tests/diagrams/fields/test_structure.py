"""The check by the schema alone says what the models say, of all fields at once."""

from __future__ import annotations

from typing import Any

import pytest
from pydantic import ValidationError

from diagrams import InputError, library_scenarios, load_scenario
from diagrams.fields import check_fields, explain, scenario_schema
from diagrams.scenario import Scenario

WRONG: list[dict[str, Any]] = [
    {"duration_s": "soon"},
    {"duration_s": True},
    {"duration_s": float("nan")},
    {"seed": 1.5},
    {"seed": -1},
    {"engine": "fast"},
    {"name": ""},
    {"name": "two\nlines"},
    {"room": 3},
    {"room": {"size_m": [1, "x"], "reverberation_time": 3}},
    {"obstacles": [{"speed_m_s": -1}, {"waypoint_m": []}]},
    {"obstacles": {"size_m": 1}},
    {"robots": {"Big": {}}},
    {"robots": {f"r{k}": {} for k in range(17)}},
    {"plant": {"slip": [1.0, 0.0]}},
    {"stop": {"odor_ahead_deg": 200, "rest_time_s": None}, "nonsense": 1},
    {"blocks": [1]},
    {"ultrasonic": {"faults": [{"kind": "odd"}]}},
]


def faults(error: InputError) -> set[tuple[str, str]]:
    return {(each.field, each.message) for each in error.all}


@pytest.mark.parametrize("data", WRONG, ids=str)
def test_it_finds_what_the_models_find(data: dict[str, Any]) -> None:
    with pytest.raises(ValidationError) as by_models:
        Scenario.model_validate(data)
    with pytest.raises(InputError) as by_schema:
        check_fields(data)
    told = explain(by_models.value, scenario_schema(), "a scenario")
    assert faults(by_schema.value) == faults(told)


@pytest.mark.parametrize("name", library_scenarios())
def test_it_takes_what_the_models_take(name: str) -> None:
    check_fields(load_scenario(name).model_dump(mode="json"))
    check_fields({"ultrasonic": {"axes_deg": 8}, "law": "my_laws:soft"})


def test_all_faults_of_a_file_are_told_at_once(tmp_path) -> None:
    path = tmp_path / "wrong.yaml"
    path.write_text(
        "reverberation_time: 3\n"
        "law: activ\n"
        "room: {reverberation_time: 0.3}\n"
        "obstacles: [{waypoint_m: [[3, 1]]}]\n"
        "robots: {one: {tdoa: {low_h: 3}}}\n"
    )
    with pytest.raises(InputError) as raised:
        load_scenario(path)
    told = {each.field: each.message for each in raised.value.all}
    for field, meant in {
        "reverberation_time": "room.reverberation_time_s",
        "law": "active",
        "room.reverberation_time": "reverberation_time_s",
        "obstacles.0.waypoint_m": "waypoints_m",
        "robots.one.tdoa.low_h": "low_hz",
    }.items():
        assert f"did you mean {meant!r}?" in told.pop(field)
    assert not told


@pytest.mark.parametrize(
    ("data", "meant", "instead"),
    [
        # What places an obstacle is one point of its way, not the place of an odour.
        (
            {"obstacles": [{"position_m": [3, 1]}]},
            "waypoints_m",
            {"obstacles": [{"waypoints_m": [[3, 1]]}]},
        ),
        (
            {"source": {"position": [3, 1]}},
            "waypoints_m",
            {"source": {"waypoints_m": [[3, 1]]}},
        ),
        (
            {"obstacles": [{"velocity_m_s": 1}]},
            "speed_m_s",
            {"obstacles": [{"speed_m_s": 1}]},
        ),
        (
            {"obstacles": [{"dimensions_m": [1, 1]}]},
            "size_m",
            {"obstacles": [{"size_m": [1, 1]}]},
        ),
        # The robot's own start, not another robot's or the odour's.
        (
            {"robots": {"one": {"position_m": [0, 1]}}},
            "robots.one.start.position_m",
            {"robots": {"one": {"start": {"position_m": [0, 1]}}}},
        ),
    ],
    ids=str,
)
def test_a_field_near_by_is_meant_before_a_far_namesake(
    data: dict[str, Any], meant: str, instead: dict[str, Any]
) -> None:
    with pytest.raises(InputError, match=rf"did you mean '{meant}'\?"):
        check_fields(data)
    check_fields(instead)


def test_faults_of_several_fields_are_told_at_once() -> None:
    with pytest.raises(InputError) as raised:
        load_scenario(
            "default",
            [
                "ultrasonic.period_s=0.03",
                "plant.motor_lag_s=0.001",
                "room.size_m=[2,2,3]",
            ],
        )
    assert [each.field for each in raised.value.all] == [
        "ultrasonic.period_s",
        "plant.motor_lag_s",
        "source.waypoints_m",
    ]
