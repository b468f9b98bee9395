"""Files of a run's sound are what the microphones gave and the loudspeakers played."""

from __future__ import annotations

import errno
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile
from numpy.typing import NDArray

from analysis.arrays.array_geometry import load_geometry
from diagrams import (
    RunAudio,
    build_sound_follower,
    load_scenario,
    make_simulator,
    simulate,
)
from phonotaxis import locate
from systems.framework.input_error import InputError
from systems.framework.signals import AudioFrame
from systems.hearing.cross_power_estimator import CrossPowerEstimator
from systems.sound.waveforms import make_waveform

COMPILED = pytest.param("compiled", marks=pytest.mark.slow)
ENGINES = pytest.mark.parametrize("engine", ["drake", COMPILED])


def saved(folder: Path, engine: Any, name: str, *overrides: str) -> Any:
    scenario = load_scenario(name, [*overrides])
    with RunAudio(scenario, folder) as audio:
        result = simulate(scenario, engine=engine, audio=audio)
    return result, audio.facts()


def counts_of(path: Path, full_scale: int = 512) -> NDArray[np.float64]:
    """(channels, n) as a reader who knows the full scale gets them."""
    return full_scale * soundfile.read(path, always_2d=True)[0].T


@pytest.fixture(scope="module")
def frames() -> NDArray[np.float64]:
    """(3, n) of ``MicArray``'s port, asked at each frame's end of a run of 1 s."""
    follower = build_sound_follower(load_scenario("default", ["duration_s=1"]))
    simulator = make_simulator(follower)
    array = follower.blocks["microphones"]
    context = array.GetMyContextFromRoot(simulator.get_context())
    heard = []
    for number in range(1, 41):
        simulator.AdvanceTo(0.025 * number)
        frame: Any = array.GetOutputPort("audio").Eval(context)
        heard.append(frame.counts)
    return np.concatenate(heard, axis=1).astype(float)


@ENGINES
def test_heard_is_what_the_microphones_give(tmp_path, engine, frames):
    result, facts = saved(tmp_path, engine, "default", "duration_s=1")
    assert result.time[-1] == facts["until_s"] == 1.0
    assert facts["heard"]["robot"]["full_scale_counts"] == 512
    read = counts_of(tmp_path / "heard.wav")
    assert read.shape == (3, 100_000)
    np.testing.assert_array_equal(read, frames)
    assert soundfile.info(tmp_path / "heard.wav").samplerate == 100_000


@ENGINES
def test_played_is_the_waveform_behind_its_gate(tmp_path, engine):
    _, facts = saved(
        tmp_path,
        engine,
        "default",
        "duration_s=1",
        "sound.on_s=0.2",
        "sound.period_s=0.5",
        "sound.start_s=0.11",
    )
    scenario = load_scenario("default", ["sound.on_s=0.2"])
    burst = make_waveform(scenario.source.sound)
    assert len(burst) == 20_000
    expected = np.zeros(100_000)
    for begin in (11_000, 61_000):
        expected[begin : begin + 20_000] = burst
    scale = facts["played"]["source"]["full_scale_pa"]
    assert scale == 0.25
    read, rate = soundfile.read(tmp_path / "played.wav")
    assert rate == 100_000
    np.testing.assert_allclose(scale * read, expected, rtol=0.0, atol=scale * 2**-31)


@ENGINES
def test_saving_changes_nothing_of_the_run(tmp_path, engine):
    scenario = load_scenario("default", ["duration_s=1"])
    with RunAudio(scenario, tmp_path) as audio:
        heard = simulate(scenario, engine=engine, audio=audio)
    plain = simulate(scenario, engine=engine)
    for name, values in plain.columns.items():
        np.testing.assert_array_equal(heard.columns[name], values)


@pytest.mark.slow
@ENGINES
def test_time_goes_on_while_nobody_listens(tmp_path, engine, monkeypatch):
    """What the estimator of a search asks for is in the file; all else is silence."""
    period = 0.025
    expected, hear = np.zeros((4, 6 * 32_000)), CrossPowerEstimator.hear

    def listen(
        self: Any, inputs: Any, audio: Callable[[], AudioFrame], memory: Any
    ) -> Any:
        def noted() -> AudioFrame:
            frame = audio()
            begin = round((frame.time - period) * 32_000)
            expected[:, begin : begin + 800] = frame.counts
            return frame

        return hear(self, inputs, noted, memory)

    # Compiles or loads, a tick aside, what would otherwise be noted, too.
    words = "sound_search", "duration_s=6"
    simulate(load_scenario(*words[:1], [words[1]]), engine=engine)
    monkeypatch.setattr(CrossPowerEstimator, "hear", listen)
    saved(tmp_path, engine, *words)
    read = counts_of(tmp_path / "heard.wav")
    # The last frame is the writer's alone: the run ends before it is listened to.
    np.testing.assert_array_equal(read[:, :-800], expected[:, :-800])
    asked = expected[0].reshape(-1, 800).any(axis=1)
    assert asked.any()
    assert not asked.all()


@ENGINES
def test_robots_and_loudspeakers_have_files_by_name(tmp_path, engine):
    frame = "robots.second.microphones.frame_s=0.05"
    _, facts = saved(tmp_path, engine, "convoy", "duration_s=0.525", frame)
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {
        "leader.heard.wav",
        "leader.array.yaml",
        "second.heard.wav",
        "second.array.yaml",
        "source.played.wav",
        "leader.played.wav",
    }
    assert facts["heard"]["second"]["file"] == "second.heard.wav"
    assert facts["played"]["leader"]["file"] == "leader.played.wav"
    # Whole frames: that of 50 ms which began at 0.5 s has not ended.
    lengths = {name: soundfile.info(tmp_path / name).frames for name in names
               if name.endswith(".wav")}  # fmt: skip
    assert lengths == {
        "leader.heard.wav": 52_500,
        "second.heard.wav": 50_000,
        "source.played.wav": 52_500,
        "leader.played.wav": 52_500,
    }


def test_locate_finds_a_source_at_rest(tmp_path):
    """The same signal through the general localizer: the truth is the simulation's."""
    places = "start.position_m=[0,0]", "source.waypoints_m=[[1.9,1.1]]"
    result, _ = saved(tmp_path, "drake", "obstacle_free", "duration_s=0.6", *places)
    geometry = load_geometry(tmp_path / "array.yaml")
    found = locate(tmp_path / "heard.wav", geometry)
    rows = found.document()["estimates"]
    assert len(rows) >= 5
    for row in rows:
        # The robot turns while it hears: the truth is that of the stretch's middle.
        true = np.interp(row["t_s"], result.time, result.columns["source_bearing_true"])
        assert abs(row["bearing_deg"] - math.degrees(true)) < 1.0
        distance = np.interp(
            row["t_s"], result.time, result.columns["source_range_true"]
        )
        assert abs(row["range_m"] - distance) < 0.05


def test_geometry_says_where_microphones_are_and_which_fail(tmp_path):
    dead = "faults=[{sensor: microphones, number: 2, kind: dead, start_s: 0.5}]"
    fields = "sound_speed_m_s=337.5", dead, "duration_s=1"
    scenario = load_scenario("default", fields)
    with RunAudio(scenario, tmp_path):
        text = (tmp_path / "array.yaml").read_text("utf-8")
        geometry = load_geometry(tmp_path / "array.yaml")
    # Han 2019, table 1: P is 0.175 m ahead of the axle, the others 0.4 m beside it.
    assert geometry.microphones == ((0.175, 0.4), (0.175, 0.0), (0.175, -0.4))
    assert geometry.c == pytest.approx(337.5)
    assert "default" in text
    assert "heard.wav" in text
    assert "Microphone 2 is dead from 0.5 s on." in text


@ENGINES
def test_an_interrupted_run_leaves_what_was_heard(tmp_path, engine, frames):
    scenario = load_scenario("default", ["duration_s=30"])

    def interrupt(time: float) -> None:
        raise KeyboardInterrupt

    with (
        pytest.raises(KeyboardInterrupt),
        RunAudio(scenario, tmp_path) as audio,
    ):
        simulate(scenario, engine=engine, progress=interrupt, audio=audio)
    assert 0.975 <= audio.until_s <= 1.0
    read = counts_of(tmp_path / "heard.wav")
    assert read.shape[1] == round(100_000 * audio.until_s)
    np.testing.assert_array_equal(read, frames[:, : read.shape[1]])
    assert load_geometry(tmp_path / "array.yaml")


@ENGINES
def test_a_full_disk_ends_the_run_and_names_the_file(tmp_path, engine, monkeypatch):
    scenario = load_scenario("default", ["duration_s=1"])
    audio = RunAudio(scenario, tmp_path)
    writer = audio._heard["robot"].writer
    write = writer._wave.writeframes

    def fail_at_half_a_second(data: bytes) -> None:
        if writer.samples >= 50_000:
            raise OSError(errno.ENOSPC, "No space left on device")
        write(data)

    monkeypatch.setattr(writer._wave, "writeframes", fail_at_half_a_second)
    with audio, pytest.raises(OSError, match="No space left") as raised:
        simulate(scenario, engine=engine, audio=audio)
    assert raised.value.filename == str(tmp_path / "heard.wav")
    assert soundfile.info(tmp_path / "heard.wav").frames == 50_000


def test_a_run_that_never_began_leaves_nothing(tmp_path):
    scenario = load_scenario("default", [])
    with RunAudio(scenario, tmp_path / "ears"):
        assert len([*(tmp_path / "ears").iterdir()]) == 3
    assert not [*(tmp_path / "ears").iterdir()]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["default", "hearing=ideal"], "save_audio: no robot .*set hearing=audio"),
        (["robots_2"], "save_audio: no robot hears .*leave --save-audio out"),
        (
            ["default", "microphones.sample_rate_hz=33333.333333333336",
             "microphones.frame_s=0.075"],
            "microphones.sample_rate_hz: .*whole number",
        ),
        (
            ["default", "duration_s=3600",
             f"robot.microphones_m={[[0, k / 10] for k in range(9)]}"],
            "duration_s: 3600 s .*4 GB.* set 2386 or less",
        ),
    ],
)  # fmt: skip
def test_what_cannot_be_saved_is_refused(tmp_path, words, message):
    name, *overrides = words
    with pytest.raises(InputError, match=message):
        RunAudio(load_scenario(name, overrides), tmp_path / "ears")
    assert not (tmp_path / "ears").exists()


def test_files_that_are_there_are_refused_and_kept(tmp_path):
    (tmp_path / "played.wav").write_text("mine")
    with pytest.raises(InputError, match=r"save_audio: .*played.wav cannot be made"):
        RunAudio(load_scenario("default", []), tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["played.wav"]
    assert (tmp_path / "played.wav").read_text() == "mine"


def test_files_are_of_one_run(tmp_path):
    scenario = load_scenario("default", ["duration_s=0.1"])
    with RunAudio(scenario, tmp_path) as audio:
        with pytest.raises(InputError, match="audio: was opened for another run"):
            simulate(load_scenario("default", ["duration_s=0.2"]), audio=audio)
        simulate(scenario, audio=audio)
        with pytest.raises(InputError, match="audio: was opened for another run"):
            simulate(scenario, audio=audio)


def test_a_robot_whose_frames_no_block_publishes_is_named(tmp_path):
    with RunAudio(load_scenario("default", []), tmp_path) as audio:
        audio.save(0, lambda owner, port: None)
        with pytest.raises(InputError, match="save_audio: no block of robot publishes"):
            audio.save(1, lambda owner, port: None)


def test_frames_of_another_array_are_refused(tmp_path):
    with RunAudio(load_scenario("default", []), tmp_path) as audio:
        counts = np.zeros((2, 2500), dtype=np.int16)
        with pytest.raises(InputError, match="none of robot's microphones"):
            audio.hear("robot", 1, AudioFrame(counts, 512, 1e5, 0.025))
