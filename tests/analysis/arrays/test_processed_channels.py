"""Channels that a device computes from its microphones are no microphones."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.arrays.processed_channels import processed_channel
from phonotaxis import ArrayGeometry, InputError, locate
from studies.support.synthetic_speech import speech_like
from systems.sound.array_shape import ArrayShape

RATE = 16_000
SQUARE = ((0.0229, 0.0229), (-0.0229, 0.0229), (-0.0229, -0.0229), (0.0229, -0.0229))
ROW = ((0.0, 0.03), (0.0, 0.0), (0.0, -0.03))
RING = tuple((0.0425 * np.cos(a), 0.0425 * np.sin(a)) for a in np.arange(6) * np.pi / 3)


def microphones(places, bearing_deg, snr_db=None, seed=3, sound=None):
    """Samples of a talker 2 m away in a free field."""
    rng = np.random.default_rng(seed)
    sound = speech_like(rng, 3.0, RATE) if sound is None else sound
    angle = np.radians(bearing_deg)
    source = 2.0 * np.array([np.cos(angle), np.sin(angle)])
    delays = np.linalg.norm(source - np.array(places), axis=1) / 343.0
    frequency = np.fft.rfftfreq(sound.size, 1 / RATE)
    shifts = np.exp(-2j * np.pi * np.outer(delays, frequency))
    samples = np.fft.irfft(shifts * np.fft.rfft(sound), sound.size)
    if snr_db is not None:
        samples += 10 ** (-snr_db / 20) * rng.standard_normal(samples.shape)
    return 0.05 * samples


def found(columns, chosen, places):
    columns = np.round(columns * 2**15) / 2**15
    shape = ArrayShape.of(places)
    got = processed_channel(columns, chosen, shape, 343.0, RATE)
    return None if got is None else got[0]


@pytest.mark.parametrize("places", [SQUARE, ROW, RING])
@pytest.mark.parametrize("snr_db", [20, 40])
@pytest.mark.parametrize("late", [0, 800])
def test_a_limited_mix_beside_its_microphones(places, snr_db, late):
    heard, n = microphones(places, 50.0, snr_db), len(places)
    mix = np.roll(np.tanh(10.0 * heard.mean(axis=0)), late)
    columns = np.vstack([mix, heard, np.zeros_like(mix)])
    assert found(columns, range(n), places) == 0
    assert found(columns, range(1, n + 1), places) is None


@pytest.mark.parametrize("places", [SQUARE, RING])
def test_late_sound_of_changing_gain(places):
    """An automatic gain of the mix of microphones of which one is not recorded."""
    heard = microphones(places, 50.0, 30)
    mix = np.roll(heard.mean(axis=0), 992)
    level = np.sqrt(np.convolve(mix**2, np.ones(800) / 800, "same"))
    columns = np.vstack([0.1 * mix / (level + 0.01), heard[:-1]])
    assert found(columns, range(len(places)), places) == 0


@pytest.mark.parametrize("places", [SQUARE, ROW, RING, (*RING, (0.0, 0.0))])
@pytest.mark.parametrize("bearing_deg", [0.0, 3.0, 50.0])
@pytest.mark.parametrize("snr_db", [None, 25])
def test_microphones_are_not_processed(places, bearing_deg, snr_db):
    heard = microphones(places, bearing_deg, snr_db)
    assert found(heard, range(len(places)), places) is None


@pytest.mark.parametrize("snr_db", [None, 30])
def test_microphones_that_hear_tones_are_not_processed(snr_db):
    times = np.arange(3 * RATE) / RATE
    tones = sum(np.sin(2 * np.pi * f * times) for f in (700, 1_500, 2_600))
    for places in (ROW, SQUARE):
        heard = microphones(places, 37.0, snr_db, sound=tones)
        assert found(heard, range(len(places)), places) is None


def test_a_late_recorder_is_not_processed():
    heard = microphones(SQUARE, 50.0, 25)
    heard[1] = 2.0 * np.roll(heard[1], 800)
    assert found(heard, range(4), SQUARE) is None


def test_locate_names_the_processed_channel():
    heard = microphones(SQUARE, 50.0, 25)
    silent = 1e-5 * np.random.default_rng(0).standard_normal(heard.shape[1])
    columns = np.vstack([np.tanh(10.0 * heard.mean(axis=0)), heard, silent])
    geometry = ArrayGeometry(microphones=SQUARE, channels=(0, 1, 2, 3))
    with pytest.raises(InputError, match=r"channel 1: processed.*\[1, 2, 3, 4\]"):
        locate(columns, geometry, sample_rate_hz=RATE)
