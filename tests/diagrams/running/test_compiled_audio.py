"""Compiled loops with sound waves are Drake's runs, and say what went wrong in them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import soundfile

from diagrams import build_sound_follower, load_scenario, simulate
from systems.framework.input_error import InputError
from systems.hearing.tdoa_estimator import TDOAEstimator

ROOM = (
    "room.size_m=[14,14,3]",
    "room.corner_m=[-6,-6]",
    "room.reverberation_time_s=0.3",
)
NOISE = ("microphones.snr_db_at_1m=5",)
SOURCES = (
    "sources.a.waypoints_m=[[2,1],[3,1]]",
    "sources.b.waypoints_m=[[1,3]]",
    "sources.b.sound.start_s=0.5",
)


@pytest.fixture(scope="module")
def sound_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("sounds") / "rain.wav"
    samples = 0.1 * np.random.default_rng(1).standard_normal(16_000)
    soundfile.write(file, samples, 16_000)
    return file


def build(*overrides, name="obstacle_free"):
    scenario = load_scenario(name, ["duration_s=3", *overrides])
    return scenario, build_sound_follower(scenario, log=True)


def assert_same(*overrides, name="obstacle_free"):
    scenario, follower = build(*overrides, name=name)
    drake = simulate(scenario, follower=follower)
    compiled = simulate(scenario, engine="compiled")
    assert compiled.cause == drake.cause
    assert compiled.robots.keys() == drake.robots.keys()
    for robot, told in drake.robots.items():
        columns = compiled.robots[robot].columns
        assert columns.keys() == told.columns.keys()
        assert told.columns["detected"].any()
        for column, values in told.columns.items():
            # Speeds are differences of places over a tick.
            atol = 1e-6 if "speed" in column else 1e-9
            found = columns[column]
            np.testing.assert_allclose(
                found, values, rtol=0.0, atol=atol, err_msg=column
            )


@pytest.mark.slow
@pytest.mark.parametrize(
    "overrides",
    [
        (),
        ROOM,
        NOISE,
        ("tdoa.method=ml", "tdoa.schedule_known=true"),
        (*SOURCES, "tdoa.choose=followed", "tdoa.first_bearing_deg=60"),
    ],
)
def test_runs_are_those_of_drake(overrides):
    assert_same(*overrides)


@pytest.mark.slow
def test_files_of_sound_and_of_the_robots_own_noise(sound_file):
    played = "sound.kind=wav", f"sound.file={sound_file}"
    assert_same(*played, f"microphones.ego_noise_file={sound_file}")


@pytest.mark.slow
def test_several_robots_and_sources_at_other_rates():
    rates = "tick_s=0.0125", "robots.far.microphones.frame_s=0.05"
    assert_same(*rates, *SOURCES, name="two_followers")


@pytest.mark.slow
def test_a_robot_that_others_hear():
    """What it emits depends on its own way, which is not known beforehand."""
    assert_same("duration_s=6", name="convoy")


@pytest.mark.slow
def test_blocks_that_are_shared_take_the_seed_of_the_run(sound_file):
    noise = f"microphones.ego_noise_file={sound_file}"
    for seed in (1, 2):
        assert_same(noise, f"seed={seed}", "sound.kind=band_noise")


@pytest.mark.slow
def test_what_goes_wrong_in_a_frame_ends_the_run():
    """A source that is not heard drives on, out of the emission's reach."""
    scenario, follower = build(
        "source.waypoints_m=[[39.6,-2.5],[41,-2.5]]",
        "microphones.snr_db_at_1m=-40",
        "stop.diverged_range_m=100",
    )
    errors = []
    for engine in ("drake", "compiled"):
        with pytest.raises(InputError, match="than the stored emission") as raised:
            simulate(scenario, follower=follower, engine=engine)
        errors.append(str(raised.value))
    assert errors[0] == errors[1]


@pytest.mark.slow
@pytest.mark.parametrize("kind", [ZeroDivisionError, KeyboardInterrupt])
def test_what_python_raises_passes_through_the_loop(monkeypatch, kind):
    scenario, follower = build("duration_s=1")
    hear, frames = TDOAEstimator.hear, []

    def fail(self, inputs, audio, memory):
        frames.append(audio().time)
        if audio().time > 0.5:
            raise kind("in a frame")
        return hear(self, inputs, audio, memory)

    simulate(scenario, follower=follower, engine="compiled")
    monkeypatch.setattr(TDOAEstimator, "hear", fail)
    with pytest.raises(kind, match="in a frame"):
        simulate(scenario, follower=follower, engine="compiled")
    assert frames[-1] == pytest.approx(0.525)
    monkeypatch.undo()
    again = simulate(scenario, follower=follower, engine="compiled")
    assert again.time[-1] == 1.0
