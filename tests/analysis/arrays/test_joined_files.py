"""Files of several recorders make the recording that one recorder would have made."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import soundfile

from analysis.arrays.joined_files import join_files
from phonotaxis import ArrayGeometry, InputError, calibrate, locate, main

RATE = 16_000
SQUARE = [[0.1, 0.1], [-0.1, 0.1], [-0.1, -0.1], [0.1, -0.1]]
BEARING_DEG = 50.0
#: When each recorder starts, s: none of the differences is a whole number of samples.
STARTS_S = (0.25, 0.1234567, 0.31, 0.0)


def tones(times, seed=1, count=40):
    """A sum of tones of 400 to 7300 Hz in bursts, known at any time."""
    rng = np.random.default_rng(seed)
    frequencies, phases = rng.uniform(400, 7_300, count), rng.uniform(0, 7, count)
    sound = np.sin(np.outer(times, 2 * np.pi * frequencies) + phases).sum(axis=1)
    return 0.02 * sound * np.sin(2 * np.pi * 2.7 * times) ** 8


def arrivals_s(places=SQUARE, bearing_deg=BEARING_DEG, range_m=2.0):
    angle = np.radians(bearing_deg)
    source = range_m * np.array([np.cos(angle), np.sin(angle)])
    return np.linalg.norm(source - np.array(places), axis=1) / 343.5


def recorders(folder, starts_s=STARTS_S, seconds=2.0, noise=1e-3):
    """Mono files of recorders that start at different times."""
    rng, paths = np.random.default_rng(5), []
    for k, (start, arrival) in enumerate(zip(starts_s, arrivals_s(), strict=True)):
        times = start - arrival + np.arange(round(seconds * RATE)) / RATE
        sound = tones(times) + noise * rng.standard_normal(times.size)
        paths.append(folder / f"mic{k + 1}.wav")
        soundfile.write(paths[-1], sound, RATE, subtype="FLOAT")
    return paths


def test_start_times_move_sound_by_parts_of_a_sample(tmp_path):
    """The tones themselves say what a recorder at another time would have heard."""
    paths = recorders(tmp_path, noise=0.0)
    samples, rate, remarks = join_files(paths, STARTS_S)
    assert (rate, remarks) == (RATE, ())
    assert samples.shape[1] == int((2.0 - 0.31) * RATE)
    times = 0.31 + np.arange(samples.shape[1]) / RATE
    for channel, arrival in zip(samples, arrivals_s(), strict=True):
        expected = tones(times - arrival)[100:-100]
        np.testing.assert_allclose(channel[100:-100], expected, atol=2e-4)


def test_recorders_are_located_as_one_array(tmp_path):
    found = locate(recorders(tmp_path), SQUARE, starts_s=STARTS_S)
    summary = found.main_source()
    assert summary["bearing_deg"] == pytest.approx(BEARING_DEG, abs=1.0)
    assert not found.notes


def test_files_in_order_are_the_channels_of_one_file(tmp_path):
    paths = recorders(tmp_path, starts_s=(0.0,) * 4)
    together = np.stack([soundfile.read(path)[0] for path in paths])
    soundfile.write(tmp_path / "pair1.wav", together[:2].T, RATE, subtype="FLOAT")
    soundfile.write(tmp_path / "pair2.wav", together[2:].T, RATE, subtype="FLOAT")
    pairs = tmp_path / "pair1.wav", str(tmp_path / "pair2.wav")
    for files in (paths, pairs):
        samples, _, remarks = join_files(files, None)
        np.testing.assert_array_equal(samples, together)
        assert not remarks
    assert locate(pairs, SQUARE).document() == locate(paths, SQUARE).document()


def test_files_of_different_lengths_are_named(tmp_path):
    paths = recorders(tmp_path, starts_s=(0.0,) * 4)
    longer = soundfile.read(paths[2])[0]
    soundfile.write(paths[2], np.append(longer, longer[:8_000]), RATE)
    samples, _, remarks = join_files(paths, None)
    assert samples.shape == (4, 2 * RATE)
    assert len(remarks) == 1
    assert "last 2.000 to 2.500 s" in remarks[0]
    assert "starts_s" in remarks[0]
    assert not join_files(paths, [0.0] * 4)[2]


def test_a_truncated_file_among_others_is_named(tmp_path):
    paths = recorders(tmp_path, starts_s=(0.0,) * 4)
    content = paths[1].read_bytes()
    paths[1].write_bytes(content[: len(content) // 2])
    found = locate(paths, SQUARE)
    assert "mic2.wav" in found.notes[0]
    assert "truncated" in found.notes[0]
    assert found.document()["remarks"] == list(found.notes)
    assert found.main_source()["bearing_deg"] == pytest.approx(BEARING_DEG, abs=1.0)


def test_numbered_files_in_the_order_of_a_shell(tmp_path):
    paths = [tmp_path / f"mic{k}.wav" for k in (1, 10, 11, 2, 3)]
    for path in paths:
        soundfile.write(path, 0.1 + tones(np.arange(400) / RATE), RATE)
    remarks = join_files(paths, None)[2]
    assert len(remarks) == 1
    assert "microphone 2 is" in remarks[0]
    assert "not " + repr(str(paths[3])) in remarks[0]
    assert not join_files([*paths[:1], *paths[3:], *paths[1:3]], None)[2]


def test_what_cannot_be_joined(tmp_path, monkeypatch):
    # Short paths, because messages are shortened in the middle.
    monkeypatch.chdir(tmp_path)
    paths = recorders(Path(), starts_s=(0.0,) * 4)
    other = Path("other.wav")
    soundfile.write(other, tones(np.arange(900) / 8_000), 8_000)
    cases = [
        ([*paths[:3], other], None, "other.wav' has a sample rate of 8000.*-r 16000"),
        (paths, [0.0, 0.1], "starts_s: has 2 values for 4 files"),
        (paths, [0.0, 0.1, np.nan, 0.0], "starts_s: .*not finite"),
        (paths, [0.0, 0.1, 9.0, 0.0], "mic1.wav' ends 7.000 s before .*mic3.wav"),
        (paths[:1], None, "mic1.wav' is mono, .*needs 4; .*one file per microphone"),
        (paths[:3], None, r"2 further files has 3 channels, but the array \S+ "),
        (paths[:1], [0.0], "starts_s: applies to several files only"),
        (tmp_path, None, "is a folder.*name the files in it"),
    ]
    for recording, starts_s, says in cases:
        with pytest.raises(InputError, match=says) as caught:
            locate(recording, SQUARE, starts_s=starts_s)
        assert "\n" not in str(caught.value)


def test_command_line_takes_files_and_start_times(tmp_path, capsys):
    paths = [str(path) for path in recorders(tmp_path)]
    geometry = tmp_path / "array.yaml"
    geometry.write_text(f"microphones: {SQUARE}\ntemperature_c: 20\n")
    words = ["locate", *paths, "--geometry", str(geometry)]
    assert main([*words, "--starts-s", "0.25,0.1234567,0.31,0"]) == 0
    assert "bearing 50." in capsys.readouterr().out.replace(
        "bearing 49.9", "bearing 50."
    )
    assert main([*words, "--starts-s", "0.25;0"]) == 2
    assert "one number per file" in capsys.readouterr().err


def test_calibration_takes_files_and_start_times(tmp_path):
    recorders(tmp_path)
    source = 2.0 * np.array([np.cos(np.radians(50.0)), np.sin(np.radians(50.0))])
    (tmp_path / "sounds.yaml").write_text(
        "sounds:\n- recording: [mic1.wav, mic2.wav, mic3.wav, mic4.wav]\n"
        f"  starts_s: {list(STARTS_S)}\n  position_m: {source.tolist()}\n"
    )
    geometry = ArrayGeometry.model_validate(
        {"microphones": SQUARE, "temperature_c": 20.0}
    )
    document = calibrate(tmp_path / "sounds.yaml", geometry).document()
    assert document["remarks"] == []
    places = np.array(document["geometry"]["microphones"])
    np.testing.assert_allclose(places, SQUARE, atol=3e-3)
