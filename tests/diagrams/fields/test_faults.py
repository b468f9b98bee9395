"""All faults of a scenario are told at once, each by its field."""

from __future__ import annotations

import pytest

from diagrams import InputError, load_scenario


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
