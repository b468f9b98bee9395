"""Searches as whole runs: both engines, endings, bad input, what is rendered."""

from __future__ import annotations

import numpy as np
import pytest

from diagrams import build_sound_follower, load_scenario, simulate
from diagrams.running.compiled import loop_blocks
from systems.framework.input_error import InputError
from systems.search import sound_search
from systems.sound.recorder import Recorder

SHORT = ["search.wait_s=2.0"]
NEAR = ["robots.finder.start.position_m=[0.1, 0.05]", "robots.finder.search.wait_s=2.0"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scenario", "settings"),
    [
        ("odor_search", SHORT),
        ("sound_search", ["room=null"]),
        pytest.param("odor_then_sound", NEAR, marks=pytest.mark.long),
    ],
)
def test_both_engines_search_alike(scenario, settings):
    drake, compiled = (
        simulate(load_scenario(scenario, settings), engine=engine)
        for engine in ("drake", "compiled")
    )
    assert {own.cause for own in drake.robots.values()} == {"found"}
    assert drake.ending == compiled.ending
    assert drake.columns.keys() == compiled.columns.keys()
    for name, values in drake.columns.items():
        other = compiled.columns[name]
        np.testing.assert_allclose(values, other, rtol=0, atol=1e-9, err_msg=name)
    assert drake.world.keys() == compiled.world.keys()
    for name, values in drake.world.items():
        np.testing.assert_allclose(values, compiled.world[name], atol=1e-9)


@pytest.mark.slow
def test_the_mission_is_told_by_radio():
    """The sink hears the find before the hearing robots listen, and their results."""
    result = simulate(load_scenario("odor_then_sound", NEAR), engine="compiled")
    world, robots = result.world, result.robots
    called = result.time[np.flatnonzero(world["finder.result"] > 0.5)[0]]
    for name in ("first", "second"):
        own = robots[name].columns
        begins = result.time[np.flatnonzero(own["listening"] > 1.5)[0]]
        assert called <= begins < called + 1.5
    assert world["first.result"][-1] == 1.0  # the run ends as the second arrives
    first, second = (
        result.time[np.flatnonzero(robots[name].columns["search_ended"] > 0.5)[0]]
        for name in ("first", "second")
    )
    assert first < second


@pytest.mark.parametrize("engine", ["drake", "compiled"])
def test_sound_is_made_only_while_somebody_listens(engine, monkeypatch):
    """0.5 s of noise at the start: 20 frames, and none in the four seconds after."""
    recorded = []
    record = Recorder.record

    def counted(self, emissions, time, *rest):
        recorded.append(time)
        return record(self, emissions, time, *rest)

    monkeypatch.setattr(Recorder, "record", counted)
    settings = ["duration_s=4.5", "room=null"]
    simulate(load_scenario("odor_then_sound", settings), engine=engine)
    assert max(recorded) < 0.6


def faults(sensor: str, kind: str, *numbers: int) -> str:
    each = [f"{{sensor: {sensor}, kind: {kind}, number: {k}}}" for k in numbers]
    return f"faults=[{', '.join(each)}]"


ENDINGS = {
    "wind.speed_m_s=0.0": "there is no wind to follow",
    faults("gas_sensors", "dead", 1, 2): "two or more gas sensors are dead",
    faults("contact_switches", "stuck_closed", 1, 2): (
        "both contact switches are stuck"
    ),
    "search.most_steps=2": "all steps are used up",
}


@pytest.mark.parametrize("setting", ENDINGS)
def test_a_search_that_cannot_go_on_is_lost_with_its_reason(setting):
    scenario = load_scenario("odor_search", [*SHORT, setting])
    result = simulate(scenario, engine="compiled")
    assert (result.cause, result.reason) == ("lost", ENDINGS[setting])
    assert result.ending == f"lost: {ENDINGS[setting]}"


def test_one_dead_sensor_and_one_stuck_switch_do_not_end_it():
    both = "faults=[{sensor: gas_sensors, number: 2, kind: dead}, "
    both += "{sensor: contact_switches, kind: stuck_closed}]"
    result = simulate(load_scenario("odor_search", [*SHORT, both]), engine="compiled")
    assert result.cause == "found"
    assert result.columns["search_fault"][-1] == 2 + 8


LOST = {
    "radio.loss=1.0": "no call was received",
    "robots.finder.search.most_steps=1": "the caller reports that it has found nothing",
}


@pytest.mark.parametrize("setting", LOST)
def test_those_that_are_not_called_are_lost_with_their_reason(setting, monkeypatch):
    monkeypatch.setattr(sound_search, "CALL_WITHIN_S", 40.0)
    monkeypatch.setattr(loop_blocks, "_SHARED", {})
    settings = [*NEAR, setting, "room=null"]
    scenario = load_scenario("odor_then_sound", [*settings, "duration_s=60.0"])
    result = simulate(scenario, engine="compiled")
    assert result.robots["first"].reason == LOST[setting]


SOUND_ENDINGS = {
    faults("microphones", "dead", 2, 3): "two or more microphones",
    "sound.kind=tone": "the sound fits several directions",
    "sound.start_s=300.0": "the caller is not heard",
}


@pytest.mark.parametrize("setting", SOUND_ENDINGS)
def test_a_sound_that_tells_nothing_ends_it_by_name(setting):
    scenario = load_scenario("sound_search", ["room=null", setting])
    result = simulate(scenario, engine="compiled")
    assert result.cause == "lost"
    assert SOUND_ENDINGS[setting] in result.reason


def test_with_three_microphones_it_still_finds():
    settings = ["room=null", faults("microphones", "dead", 3)]
    settings += ["sound_search.radio_stop_m=0.5"]
    result = simulate(load_scenario("sound_search", settings), engine="compiled")
    assert result.cause == "found"
    assert result.columns["search_fault"][-1] == 32.0


REFUSED = [
    ("odor_search", ["odor=null"], "odor: is missing"),
    (
        "odor_search",
        ["guard={}"],
        "guard: is not a field of robots that search for an odor",
    ),
    ("odor_search", ["odor.kind=steady", "wind.speed_m_s=0.0"], "wind.speed_m_s: is 0"),
    (
        "odor_search",
        ["room={size_m: [5.2, 3.2, 2.7]}", "odor.position_m=[9.0, 0.0]"],
        "odor.position_m",
    ),
    ("odor_search", [faults("gas_sensors", "dead", 1, 1)], "two faults"),
    ("odor_search", ["obstacles.0.name=odor"], "the name 'odor' is taken"),
    ("odor_search", ["robots={odor: {}}"], "the name 'odor' is taken"),
    ("odor_search", ["robots={world: {}}"], "the name 'world' is taken"),
    (
        "sound_search",
        ["hearing=ideal"],
        "hearing: is not a field of robots that search for a sound",
    ),
    ("sound_search", ["robot.preset=han2019"], "robot.microphones_m: has 3"),
    ("sound_search", ["sound_search.await_call=true"], "sound_search.await_call: is"),
    (
        "odor_then_sound",
        ["robots.second.sound_search.address=2"],
        "address: 2 is that of",
    ),
]


@pytest.mark.parametrize(("scenario", "settings", "complaint"), REFUSED)
def test_what_cannot_be_searched_is_refused_by_name(scenario, settings, complaint):
    with pytest.raises(InputError) as caught:
        build_sound_follower(load_scenario(scenario, settings))
    assert complaint in str(caught.value)


def test_a_find_away_from_the_source_is_a_false_one():
    """Without the gate the robot takes the first wall for the source."""
    settings = [*SHORT, "search.gate=false", "search.rules=song2011"]
    settings += ["start.position_m=[1.0, 1.35]", "start.heading_deg=-45.0"]
    result = simulate(load_scenario("odor_search", settings), engine="compiled")
    assert (result.cause, result.reason) == ("false find", "")
