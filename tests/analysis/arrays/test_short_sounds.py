"""Clicks and chirps of milliseconds, in the free field and in a room."""

from __future__ import annotations

import math

import numpy as np
import pyroomacoustics
import pytest
import soundfile

from analysis.arrays.array_geometry import ArrayGeometry
from analysis.arrays.recording_spectra import OnsetSpectra
from phonotaxis import locate
from systems.delays.delay_sets import consistent_lags
from systems.sound.array_shape import ArrayShape

RATE, C = 48_000, 343.0
# A star of 1.4 m that looks along +x, with its middle 1.5 m above the floor.
STAR = 0.8 * np.array(
    [[0, 0, 0], [0, 0, 1], [0, 0.866, -0.5], [0, -0.866, -0.5]], dtype=float
)
ROOM_M = (9.0, 7.0, 3.5)


def chirp(seconds, low=1_500.0, high=14_000.0):
    t = np.arange(round(seconds * RATE)) / RATE
    phase = low * t + 0.5 * (high - low) / seconds * t**2
    return np.sin(2.0 * np.pi * phase) * np.hanning(t.size) ** 0.25


def record(path, source, seconds, t60, *, sounds=4, snr_db=40.0):
    """The same chirp several times over, each with its echoes."""
    gap = np.zeros(round((0.3 + t60) * RATE))
    one = np.concatenate((chirp(seconds), gap))
    played = np.concatenate([np.zeros(RATE // 5), *[one] * sounds])
    absorption, order = pyroomacoustics.inverse_sabine(t60, ROOM_M)
    room = pyroomacoustics.ShoeBox(
        ROOM_M,
        fs=RATE,
        materials=pyroomacoustics.Material(absorption),
        max_order=min(order, 14),
    )
    room.set_sound_speed(C)
    center = np.array([2.0, 3.0, 1.5])
    room.add_source(center + source, signal=played)
    room.add_microphone_array((STAR + center).T)
    room.simulate()
    heard = room.mic_array.signals
    noise = np.random.default_rng(7).standard_normal(heard.shape)
    heard = heard + np.abs(heard).max() * 10.0 ** (-snr_db / 20.0) * noise
    soundfile.write(path, 0.5 * heard.T / np.abs(heard).max(), RATE, subtype="PCM_24")
    return path


def exact_star():
    return ArrayGeometry.model_validate(
        {
            "microphones": STAR.tolist(),
            "sound_speed": C,
            "sound_speed_std": 0.0,
            "position_std_m": 0.0001,
            "side": "ahead",
        }
    )


@pytest.mark.parametrize("seconds", [0.003, 0.01, 0.05, 0.1])
@pytest.mark.parametrize("bearing", [-25.0, 12.0])
def test_short_sounds_five_meters_away_in_an_echoing_room(tmp_path, seconds, bearing):
    azimuth, height = math.radians(bearing), math.radians(10.0)
    level = 5.0 * math.cos(height)
    source = np.array(
        [
            level * math.cos(azimuth),
            level * math.sin(azimuth),
            5.0 * math.sin(height),
        ]
    )
    path = record(tmp_path / "a.wav", source, seconds, 0.6)
    result = locate(path, exact_star())
    assert result.frames == len(result.estimates) == 4
    ranges = np.array([e.range_m for e in result.estimates], dtype=float)
    from_centroid = np.linalg.norm(source - STAR.mean(axis=0))
    assert np.abs(ranges / from_centroid - 1.0).max() < 0.05
    assert ranges.std() < 0.05
    for estimate in result.estimates:
        assert estimate.bearing_deg == pytest.approx(bearing, abs=0.5)


def test_echoes_between_claps_are_no_certain_sources():
    """Most of the time, echoes of the claps come from another direction."""
    places = 0.05 * np.array([[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0.0]])
    rng = np.random.default_rng(4)
    clap = rng.standard_normal(240) * np.hanning(240)
    echoes = np.convolve(clap, rng.standard_normal(9600))
    echoes *= 0.3 / echoes.std()
    f = np.fft.rfftfreq(RATE, 1.0 / RATE)
    heard = 1e-3 * rng.standard_normal((4, 2 * RATE))
    for bearing, at_s, sound in ((20.0, 0.2, clap), (110.0, 0.22, echoes)):
        early = places @ [*np.cos(np.radians([bearing, bearing - 90.0])), 0.0] / C
        turned = np.exp(-2j * np.pi * np.outer(at_s - early, f))
        rows = np.fft.irfft(np.fft.rfft(sound, RATE) * turned, RATE)
        heard += np.hstack((rows, rows))
    stated = {"microphones": places.tolist(), "sound_speed": C}
    geometry = ArrayGeometry.model_validate(stated)
    result = locate(heard, geometry, sample_rate_hz=RATE)
    heard_sources = result.heard.sources
    assert any(s.confidence > 0.5 and s.bearing_deg > 100.0 for s in heard_sources)
    first, *others = result.document()["sources"]
    assert first["bearing_deg"] == pytest.approx(20.0, abs=1.0)
    assert first["confidence"] > 0.5
    assert others
    assert all(other["confidence"] <= 0.5 for other in others)
    assert "echoes" in result.main_source()["doubt"]


def test_onsets_are_where_the_sounds_begin_and_echoes_are_none():
    rng = np.random.default_rng(2)
    length, at = 3 * RATE, [0.7, 1.6, 2.4]
    channel = np.zeros(length)
    decay = 10.0 ** (-3.0 * np.arange(RATE) / RATE / 0.6)
    for begin in at:
        k = round(begin * RATE)
        tail = 0.3 * (decay * rng.standard_normal(RATE))[: length - k]
        channel[k : k + tail.size] += tail
        channel[k : k + RATE // 100] += chirp(0.01)
    channels = np.stack([channel, channel]) + 1e-3 * rng.standard_normal((2, length))
    sounds = OnsetSpectra(channels.astype(np.float32), RATE, 300.0, 15_000.0, 1e-3)
    np.testing.assert_allclose(1e-3 * sounds.onsets, at, atol=2.1e-3)
    assert sounds.are_most


def test_syllables_and_noise_are_no_short_sounds():
    rng = np.random.default_rng(3)
    t = np.arange(3 * RATE) / RATE
    for level in (np.ones(t.size), np.clip(np.sin(2 * np.pi * 1.1 * t), 0.01, 1.0)):
        channels = (level * rng.standard_normal((2, t.size))).astype(np.float32)
        sounds = OnsetSpectra(channels, RATE, 300.0, 15_000.0, 1e-3)
        assert not sounds.are_most


def test_lags_that_belong_together_win_over_higher_peaks():
    """Each pair has a higher peak of its own; the low ones alone add up."""
    shape = ArrayShape.of(STAR)
    true = np.array([0, 40, -25, 60])
    rng = np.random.default_rng(5)
    correlations = np.zeros((len(shape.pairs), 401), dtype=np.float32)
    for row, (i, j) in zip(correlations, shape.pairs, strict=True):
        row[:] = 0.02 * rng.standard_normal(row.size)
        row[200 + rng.integers(-150, 150)] = 0.6
        row[200 + true[j] - true[i]] = 0.5
    reach = np.full(len(shape.pairs), 200)
    best = consistent_lags(correlations, shape.pairs, reach, 3)[0]
    np.testing.assert_allclose(best, true, atol=2)


def test_lags_beyond_what_sound_takes_are_no_set():
    shape = ArrayShape.of(STAR)
    correlations = np.zeros((len(shape.pairs), 401), dtype=np.float32)
    correlations[:, 300] = 1.0
    reach = np.full(len(shape.pairs), 50)
    for lags in consistent_lags(correlations, shape.pairs, reach, 3):
        i, j = shape.pairs.T
        assert np.abs(lags[j] - lags[i]).max() <= 50
