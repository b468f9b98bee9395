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
        "room.reverberation_time": "room.reverberation_time_s",
        "obstacles.0.waypoint_m": "obstacles.0.waypoints_m",
        "robots.one.tdoa.band_h": "robots.one.tdoa.band_hz",
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
            "obstacles.0.waypoints_m",
            {"obstacles": [{"waypoints_m": [[3, 1]]}]},
        ),
        (
            {"source": {"position": [3, 1]}},
            "source.waypoints_m",
            {"source": {"waypoints_m": [[3, 1]]}},
        ),
        (
            {"obstacles": [{"velocity_m_s": 1}]},
            "obstacles.0.speed_m_s",
            {"obstacles": [{"speed_m_s": 1}]},
        ),
        (
            {"obstacles": [{"dimensions_m": [1, 1]}]},
            "obstacles.0.size_m",
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


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("source.speed=0.5", "did you mean 'source.speed_m_s'?"),
        ("speed=0.5", "did you mean 'source.speed_m_s'?"),
        ("walls=[]", "did you mean 'obstacles'?"),
        ("time=3", "did you mean 'duration_s'?"),
        ("noise=0", "did you mean 'ultrasonic.noise_m'?"),
        ("robot.max_speed=1", "did you mean 'robot.top_speed_m_s'?"),
        ("attraction.K_r=3", "did you mean 'attraction.stiffness_n_m'?"),
        ("room.width_m=5", "is not a field of a scenario; room has size_m, "),
        ("guard.margin=1", "place_error_m, start_bubble_m; use one of them, or remove"),
        ("doppler=1", "is not a field of a scenario; remove it"),
        ("source.waypoints_m=[2.0, 0.0]", "give a list of lists, [[2.0, 0.0]]"),
        (
            "obstacles.box.waypoints_m=[2, 0]",
            "list of lists, [[2, 0]]",
        ),
        ("start.position_m=0,1", "give a list, [0,1]"),
        ("room.size_m=5", "is 5; give a list, for example ["),
        ("room=true", "is True; give its fields as a mapping; {} means their defaults"),
        ("source=1", "is 1; give its fields as a mapping"),
        ("sound=x.wav", "write sound.kind=wav and sound.file=x.wav"),
        ("source.speed_m_s=", "is empty (null); input should be a valid number"),
        ("obstacles[x].size_m=1", "did you mean 'obstacles'?"),
    ],
)
def test_a_message_begins_with_the_remedy(setting: str, message: str) -> None:
    with pytest.raises(InputError) as raised:
        load_scenario("default", [setting])
    (only,) = raised.value.all
    assert message in only.message
    if "remove it" in only.message:
        assert only.message.endswith("remove it")


def test_indices_may_have_brackets() -> None:
    by_dot = load_scenario("default", {"obstacles.0.size_m": [1.0, 2.0]})
    assert load_scenario("default", ["obstacles[0].size_m=[1.0, 2.0]"]) == by_dot
    assert load_scenario("default", {"obstacles[0].size_m": [1.0, 2.0]}) == by_dot


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
