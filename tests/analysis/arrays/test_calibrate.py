"""Calibration from recordings: what is heard, refused, told and written."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
import soundfile

import phonotaxis
from analysis.arrays.array_geometry import ArrayGeometry, load_geometry
from analysis.arrays.calibrate import (
    calibrate,
    calibrated_fields,
    calibration_run,
)
from analysis.arrays.calibration_sounds import load_calibration_sounds
from analysis.arrays.calibration_text import (
    calibration_document,
    calibration_text,
    write_calibration,
)
from analysis.arrays.heard_sounds import heard_sound, sightings_of
from analysis.arrays.recording_search import Sighting
from systems.framework.input_error import InputError
from systems.sound.array_shape import ArrayShape
from tests.analysis.arrays.arrays import (
    SIX,
    SQUARE,
    drawn,
    measured,
    noise_covariance,
    spots_around,
)

RATE = 16_000


def record(path, places, spot, c, rng, seconds=0.6):
    """Writes bursts of noise as these microphones hear them, with noise of their own.

    Delays are exact: phases of the noise's spectrum.
    """
    length = round(seconds * RATE)
    f = np.fft.rfftfreq(length, 1 / RATE)
    noise = np.fft.irfft(
        np.exp(2j * np.pi * rng.random(f.size)) * ((f > 400) & (f < 6000)), length
    )
    noise *= np.sin(2 * np.pi * 4 * np.arange(length) / RATE) ** 2
    far = np.linalg.norm(spot - places, axis=1)
    shifts = np.exp(-2j * np.pi * f * far[:, np.newaxis] / c) / far[:, np.newaxis]
    rows = np.fft.irfft(np.fft.rfft(noise) * shifts, length)
    rows += 0.03 * rows.std() * rng.standard_normal(rows.shape)
    soundfile.write(path, 0.1 * rows.T / rows.std(), RATE, subtype="PCM_24")


def listing(folder, entries):
    path = folder / "sounds.yaml"
    path.write_text(json.dumps({"sounds": entries}))
    return path


def stated(places, **fields):
    return ArrayGeometry.model_validate(
        {"microphones": places.tolist(), "position_std_m": 0.02, **fields}
    )


@pytest.fixture(scope="module")
def nine(tmp_path_factory):
    """Recordings of nine known places by a square that is 2 cm off."""
    folder = tmp_path_factory.mktemp("nine")
    rng = np.random.default_rng(5)
    places, c, _ = drawn(SQUARE, rng)
    entries = []
    for k, spot in enumerate(spots_around(9, rng)):
        record(folder / f"{k}.wav", places, spot, c, rng)
        entries.append(
            {
                "recording": f"{k}.wav",
                "position_m": (spot + 0.005 * rng.standard_normal(3)).tolist(),
                "position_std_m": 0.005,
            }
        )
    (folder / "array.yaml").write_text(
        json.dumps(
            {
                "microphones": SQUARE.tolist(),
                "position_std_m": 0.02,
                "temperature_c": 20,
                "temperature_std_c": 6,
                "side": "above",
                "delay_std_s": 1e-7,
            }
        )
    )
    return folder, places, c, entries


def call(capsys, *words):
    status = phonotaxis.main([str(word) for word in words])
    printed = capsys.readouterr()
    return status, printed.out, printed.err


def test_recordings_of_known_places(capsys, nine, tmp_path):
    """From 2 cm to what the positions' 5 mm allow; locate reads what is written."""
    folder, places, c, entries = nine
    out = tmp_path / "out"
    words = ["calibrate", listing(folder, entries)]
    words += ["--geometry", folder / "array.yaml", "--out", out]
    status, printed, complaint = call(capsys, *words, "--json")
    assert (status, complaint) == (0, "")
    document = json.loads(printed)
    assert {p.name for p in out.iterdir()} == {"array.yaml", "calibration.json"}
    assert {**json.loads((out / "calibration.json").read_text()), "out": str(out)} == (
        document
    )
    geometry = load_geometry(out / "array.yaml")
    covariance = np.array(document["covariance"])
    np.testing.assert_allclose(
        geometry.known.budget.of_places, covariance[:12, :12], rtol=1e-9, atol=1e-17
    )
    assert geometry.known.budget.speed_std == pytest.approx(
        math.sqrt(covariance[12, 12])
    )
    assert (geometry.side, geometry.delay_std_s) == ("above", 1e-7)
    off = np.array(geometry.microphones) - places
    # Chi-square of the errors by the covariance that is stated: 12 values.
    z = np.append(off.ravel(), geometry.c - c)
    assert z @ np.linalg.solve(covariance[:13, :13], z) < 35.0
    assert np.sqrt(np.mean(off**2)) < 0.3 * np.sqrt(np.mean((SQUARE - places) ** 2))
    assert document["fits"]
    assert call(capsys, "locate", folder / "0.wav", "--geometry", out / "array.yaml")[
        0
    ] in (0, 2)


def test_python_gives_what_the_command_prints(capsys, nine, tmp_path):
    folder, _, _, entries = nine
    words = [listing(folder, entries), folder / "array.yaml"]
    status, printed, _ = call(capsys, "calibrate", words[0], "--geometry", words[1])
    assert status == 0
    found = phonotaxis.calibrate(*words)
    assert str(found) == printed.rstrip("\n")
    assert found.notes == ()
    out = found.save(tmp_path / "out")
    assert found.geometry == load_geometry(out / "array.yaml")
    points = found.plot().axes[0].lines[0].get_xydata()
    np.testing.assert_array_equal(points, SQUARE[:, :2])


def test_a_wrong_position_is_named_on_the_terminal(capsys, nine):
    folder, _, _, entries = nine
    wrong = [dict(entry) for entry in entries]
    wrong[3]["position_m"] = [
        wrong[3]["position_m"][0] + 0.5,
        *entries[3]["position_m"][1:],
    ]
    words = ["calibrate", listing(folder, wrong), "--geometry", folder / "array.yaml"]
    status, printed, _ = call(capsys, *words)
    assert status == 0
    assert "DO NOT AGREE; without sound 4 (3.wav) they agree" in printed


def test_blind_calibration_says_that_it_gains_nothing(capsys, nine):
    folder, _, _, entries = nine
    blind = [{"recording": entry["recording"]} for entry in entries]
    words = ["calibrate", listing(folder, blind), "--geometry", folder / "array.yaml"]
    status, printed, _ = call(capsys, *words)
    assert status == 0
    assert "no gain" in printed
    assert "3 delays for 3 unknowns" in printed
    assert "\nobservable" not in printed


def test_part_of_a_recording(nine):
    folder, places, c, _ = nine
    rows = [soundfile.read(folder / f"{k}.wav")[0] for k in (0, 1)]
    soundfile.write(folder / "both.wav", np.vstack(rows), RATE, subtype="PCM_24")
    geometry = stated(places, sound_speed=c)
    for k in (0, 1):
        found, _ = sightings_of(folder / "both.wav", geometry, 0.6 * k, 0.6 * (k + 1))
        alone, _ = sightings_of(folder / f"{k}.wav", geometry)
        np.testing.assert_allclose(
            heard_sound(found, geometry.known.shape, c).tau,
            heard_sound(alone, geometry.known.shape, c).tau,
            atol=1e-8,
        )


@pytest.mark.parametrize("scale", [1.0, 3.0])
def test_mean_of_stretches_counts_their_scatter(scale):
    """Stretches that scatter three times as much as they say, as the mean shows."""
    rng = np.random.default_rng(2)
    covariance = noise_covariance(4)
    root = np.linalg.cholesky(covariance)
    off, said = [], []
    for _ in range(200):
        # Stretches overlap by half: neighbors share half of their noise.
        noise = rng.standard_normal((21, 3)) @ root.T
        tau = 1e-3 + scale * (noise[1:] + noise[:-1]) / math.sqrt(2)
        heard = heard_sound(
            [Sighting(row, covariance, 1.0, 0.1 * k) for k, row in enumerate(tau)],
            ArrayShape.of(SQUARE),
            340.0,
        )
        off.append(heard.tau - 1e-3)
        said.append(np.sqrt(np.diag(heard.covariance)))
    assert np.mean(said) == pytest.approx(np.std(off), rel=0.25)


def test_a_stretch_of_something_else_is_left_out():
    covariance = noise_covariance(4)
    tau = 1e-3 + 1e-6 * np.random.default_rng(3).standard_normal((9, 3))
    tau[4] += 1e-3
    sightings = [Sighting(row, covariance, 1.0, 0.0) for row in tau]
    heard = heard_sound(sightings, ArrayShape.of(SQUARE), 340.0)
    assert (heard.stretches, heard.used) == (9, 8)
    np.testing.assert_allclose(heard.tau, 1e-3, atol=3e-6)


def test_large_arrays_fit_into_a_file(tmp_path):
    """64 microphones: a deviation each, as no file holds all covariances."""
    rng = np.random.default_rng(4)
    nominal = rng.uniform(-1, 1, (64, 3))
    places, c, late = drawn(nominal, rng)
    geometry = stated(nominal)
    sounds = measured(places, c, late, spots_around(8, rng), rng)
    run = calibration_run(sounds, geometry)
    write_calibration(calibration_document(run), tmp_path)
    written = load_geometry(tmp_path / "array.yaml")
    assert np.trace(written.known.budget.of_places) == pytest.approx(
        np.trace(run.calibration.of_places)
    )


def test_a_side_that_the_array_no_more_has_is_left_out():
    rng = np.random.default_rng(6)
    places, c, late = drawn(SQUARE, rng)
    places[0, 2] += 0.25
    geometry = stated(SQUARE, side="above").model_copy(update={"position_std_m": 0.1})
    sounds = measured(places, c, late, spots_around(9, rng), rng)
    run = calibration_run(sounds, geometry)
    fields = calibrated_fields(run.calibration, geometry)
    assert "side" not in fields
    ArrayGeometry.model_validate(fields)


def test_text_of_a_plane_array():
    rng = np.random.default_rng(7)
    nominal = SIX[:, :2]
    places, c, late = drawn(nominal, rng)
    sounds = measured(places, c, late, spots_around(9, rng)[:, :2], rng)
    text = calibration_text(calibration_run(sounds, stated(nominal)))
    assert "places of microphones: 20 mm -> " in text
    assert "speed of sound: 1 % -> " in text
    assert "rotation of the array about z: " in text
    assert "about x" not in text


@pytest.mark.parametrize(
    ("entry", "field", "words"),
    [
        ({"recording": "none.wav"}, "sounds.0.recording", "none.wav' is not a file"),
        ({"recording": "text.wav"}, "sounds.0.recording", "text.wav' is not a read"),
        (
            {"recording": "0.wav", "position_m": [1.0, 2.0]},
            "sounds.0.position_m",
            "has 2 coordinates and the microphones have 3",
        ),
        (
            {"recording": "0.wav", "position_m": [0.5, 0.5, 0.02]},
            "sounds.0.position_m",
            "2.0 cm from microphone 1",
        ),
        (
            {"recording": "0.wav", "position_m": [0, 5000, 0]},
            "sounds.0.position_m",
            "in m, at most 1000 m",
        ),
        ({"recording": "0.wav", "from_s": 9}, "sounds.0.recording", "0.600 s"),
    ],
)
def test_bad_entries(nine, entry, field, words):
    folder = nine[0]
    (folder / "text.wav").write_text("no sound")
    sounds = load_calibration_sounds(listing(folder, [entry]))
    with pytest.raises(InputError, match=words) as caught:
        calibrate(sounds, stated(SQUARE))
    assert caught.value.field == field


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "lists no sounds"),
        ("sounds: []", "lists no sounds"),
        ("sounds: [{recording: a.wav, place: [1, 2]}]", "is not a field"),
        ("sounds: [{recording: a.wav, position_std_m: -1}]", "greater than or equal"),
        ("sounds: [{recording: a.wav, from_s: 2, to_s: 1}]", "not after from_s"),
        ("sounds: [{recording: a.wav, position_m: [1]}]", "at least 2"),
    ],
)
def test_bad_lists(tmp_path, text, words):
    path = tmp_path / "sounds.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=words):
        load_calibration_sounds(path)


def test_missing_list_is_one_line(capsys):
    status, printed, complaint = call(capsys, "calibrate", Path("none.yaml"))
    assert (status, printed) == (2, "")
    assert complaint.count("\n") == 1
    assert "none.yaml" in complaint


def test_silence_is_named(tmp_path):
    rng = np.random.default_rng(8)
    noise = 0.1 * rng.standard_normal((RATE, 4))
    soundfile.write(tmp_path / "a.wav", noise, RATE)
    entry = {"recording": "a.wav", "position_m": [2, 1, 1]}
    sounds = load_calibration_sounds(listing(tmp_path, [entry]))
    with pytest.raises(InputError, match="no recording has a detectable sound"):
        calibrate(sounds, stated(SQUARE))
