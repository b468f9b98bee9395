"""Recordings in rooms of image sources, with words and pauses."""

from __future__ import annotations

import math

import numpy as np
import pyroomacoustics
import pytest
import soundfile
from scipy import signal

from analysis.arrays.array_geometry import ArrayGeometry
from phonotaxis import locate

RATE = 16_000
ROOM_M = (6.0, 5.0, 2.8)
CENTER_M = np.array([2.6, 2.2, 1.2])

SMALL_SQUARE = [
    [0.023, 0.023, 0],
    [-0.023, 0.023, 0],
    [-0.023, -0.023, 0],
    [0.023, -0.023, 0],
]
CIRCLE = [[0.1 * math.cos(a), 0.1 * math.sin(a), 0] for a in np.pi * np.arange(8) / 4]
TETRAHEDRON = [
    [0.06, 0.06, 0.06],
    [0.06, -0.06, -0.06],
    [-0.06, 0.06, -0.06],
    [-0.06, -0.06, 0.06],
]
ROW = [[0.0, 0.4], [0.0, 0.0], [0.0, -0.4]]


def words(rng, seconds=3.0):
    """Noise with the long-term spectrum of speech, in syllables and pauses."""
    noise = rng.standard_normal(round(seconds * RATE))
    low = signal.butter(1, 500.0, fs=RATE, output="sos")
    high = signal.butter(2, 150.0, "high", fs=RATE, output="sos")
    voice = signal.sosfilt(high, signal.sosfilt(low, noise))
    time = np.arange(voice.size) / RATE
    syllables = np.clip(np.sin(2 * np.pi * 4.0 * time), 0.0, 1.0) ** 2
    return voice * syllables * (np.sin(2 * np.pi * 0.7 * time) > -0.3)


def record(path, places, bearing, elevation, distance, t60, snr_db=20.0):
    rng = np.random.default_rng(11)
    places = np.array(places, dtype=float)
    heard_by = np.pad(places, ((0, 0), (0, 3 - places.shape[1])))
    azimuth, height = math.radians(bearing), math.radians(elevation)
    level = math.cos(height)
    u = [level * math.cos(azimuth), level * math.sin(azimuth), math.sin(height)]
    absorption, order = pyroomacoustics.inverse_sabine(t60, ROOM_M)
    room = pyroomacoustics.ShoeBox(
        ROOM_M,
        fs=RATE,
        materials=pyroomacoustics.Material(absorption),
        max_order=min(order, 25),
    )
    room.set_sound_speed(340.0)
    room.add_source(CENTER_M + distance * np.array(u), signal=words(rng))
    centered = heard_by - heard_by.mean(axis=0)
    room.add_microphone_array((centered + CENTER_M).T)
    room.simulate()
    heard = room.mic_array.signals
    level = heard.std() * 10 ** (-snr_db / 20)
    heard = heard + level * rng.standard_normal(heard.shape)
    soundfile.write(path, 0.5 * heard.T / np.abs(heard).max(), RATE, subtype="PCM_24")
    microphones = tuple(map(tuple, places.tolist()))
    exact = ArrayGeometry(microphones=microphones, position_std_m=0.0005)
    return locate(path, exact)


@pytest.mark.parametrize(
    ("places", "bearing", "elevation", "distance", "t60"),
    [
        (SMALL_SQUARE, 180.0, 20.0, 1.5, 0.4),
        (SMALL_SQUARE, -50.0, 20.0, 2.0, 0.25),
        (CIRCLE, 110.0, 15.0, 2.0, 0.5),
        (TETRAHEDRON, -100.0, -20.0, 1.5, 0.4),
    ],
)
def test_bearing_in_a_room(tmp_path, places, bearing, elevation, distance, t60):
    result = record(tmp_path / "a.wav", places, bearing, elevation, distance, t60)
    summary = result.main_source()
    errors = [(e.bearing_deg - bearing + 180) % 360 - 180 for e in result.estimates]
    assert len(errors) >= 10
    assert abs((summary["bearing_deg"] - bearing + 180) % 360 - 180) < 3.0
    assert np.mean(np.abs(errors) < 10.0) > 0.9
    # A small array sees no range, whatever reflections make of its delays.
    assert summary["range_m"] is None
    assert "range" not in summary["observable"]


def test_range_of_a_long_row_in_a_room(tmp_path):
    result = record(tmp_path / "a.wav", ROW, 25.0, 0.0, 1.5, 0.3)
    summary = result.main_source()
    assert summary["bearing_deg"] == pytest.approx(25.0, abs=1.0)
    assert summary["range_m"] == pytest.approx(1.5, rel=0.1)
    assert summary["alternatives"][0]["bearing_deg"] == pytest.approx(155.0, abs=1.0)


def test_stated_errors_hold_in_a_room(tmp_path):
    """Reflections move bands together, too: still within twice what is stated."""
    result = record(tmp_path / "a.wav", CIRCLE, 110.0, 15.0, 1.5, 0.4)
    errors = np.array([e.bearing_deg - 110.0 for e in result.estimates])
    stated = np.array([e.bearing_std_deg for e in result.estimates])
    assert 0.5 * np.median(stated) < np.median(np.abs(errors)) / 0.6745
    assert np.median(np.abs(errors)) / 0.6745 < 2.0 * np.median(stated)


@pytest.mark.slow
@pytest.mark.parametrize("places", [SMALL_SQUARE, CIRCLE, TETRAHEDRON, ROW])
def test_no_fault_is_named_in_good_recordings(tmp_path, places):
    rng = np.random.default_rng(len(places))
    for _ in range(6):
        result = record(
            tmp_path / "a.wav",
            np.array(places) * rng.uniform(0.8, 1.6),
            bearing=rng.uniform(-180.0, 180.0),
            elevation=rng.uniform(-10.0, 35.0),
            distance=rng.uniform(0.8, 2.0),
            t60=rng.uniform(0.2, 0.5),
            snr_db=rng.uniform(10.0, 30.0),
        )
        assert result.faults == []
