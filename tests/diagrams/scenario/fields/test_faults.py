"""All faults of a scenario are told at once, each by its field."""

from __future__ import annotations

from typing import Any

import pytest

from diagrams import load_scenario
from diagrams.scenario.scenario import scenario_from_mapping
from systems.framework.input_error import InputError


def test_all_faults_of_a_file_are_told_at_once(tmp_path) -> None:
    path = tmp_path / "wrong.yaml"
    path.write_text(
        "reverberation_time: 3\n"
        "law: activ\n"
        "room: {reverberation_time: 0.3}\n"
        "obstacles: [{waypoint_m: [[3, 1]]}]\n"
        "robots: {one: {tdoa: {band_h: 3}}, two: {law: guardet}}\n"
    )
    with pytest.raises(InputError) as raised:
        load_scenario(path)
    told = {each.field: each.message for each in raised.value.all}
    for field, meant in {
        "reverberation_time": "room.reverberation_time_s",
        "law": "active",
        "room.reverberation_time": "reverberation_time_s",
        "obstacles.0.waypoint_m": "waypoints_m",
        "robots.one.tdoa.band_h": "band_hz",
        "robots.two.law": "guarded",
    }.items():
        assert f"did you mean {meant!r}?" in told.pop(field)
    assert not told


@pytest.mark.parametrize(
    ("data", "meant", "instead"),
    [
        # What places an obstacle is one point of its way, not the place of an odor.
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
        # The robot's own start, not another robot's or the odor's.
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
        scenario_from_mapping(data)
    scenario_from_mapping(instead)


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
