"""Clips of milliseconds: each has an answer, or a reason why there is none."""

from __future__ import annotations

import json

import numpy as np
import pytest

from analysis.arrays.array_geometry import ArrayGeometry
from phonotaxis import locate
from systems.framework.input_error import InputError

C = 343.2


def plane_wave(sound, places, u, rate):
    """The sound, delayed at each microphone by a whole number of samples."""
    early = np.rint(places @ u / C * rate).astype(int)
    return np.stack([np.roll(sound, -k) for k in early])


@pytest.mark.parametrize(
    ("rate", "seconds", "size_m"),
    [
        (8_000, 0.001, 0.02),
        (8_000, 0.03, 1.5),
        (8_000, 0.3, 60.0),
        (44_100, 0.004, 0.02),
        (44_100, 0.06, 1.5),
        (192_000, 0.001, 1.5),
        (192_000, 0.03, 60.0),
        (192_000, 0.1, 0.02),
        (500_000, 0.001, 0.02),
        (500_000, 0.03, 1.5),
    ],
)
def test_any_clip_has_an_answer_or_a_reason(rate, seconds, size_m):
    seed = round(rate * seconds * size_m)
    rng = np.random.default_rng(seed)
    places = size_m * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.3, 0.3, 0.7]])
    count = min(round(rate * seconds), 60_000)
    sounds = {
        "noise": rng.standard_normal(count),
        "click": np.eye(1, count, count // 2)[0],
        "late chirp": np.sin(0.3 * np.arange(count) ** 1.1) * (
            np.arange(count) > 0.6 * count
        ),
    }  # fmt: skip
    for sound in sounds.values():
        heard = plane_wave(sound, places, np.array([0.6, 0.64, 0.48]), rate)
        heard = heard + 1e-3 * rng.standard_normal(heard.shape)
        try:
            result = locate(heard, places.tolist(), sample_rate_hz=rate)
        except InputError:
            continue
        assert str(result)
        json.dumps(result.document(), allow_nan=False)


def test_a_chirp_that_begins_late_in_a_clip_of_a_third_of_a_second():
    rate = 192_000
    places = np.array([[0, 0, 0], [1.4, 0, 0], [0.2, 1.3, 0], [0.4, 0.3, 1.0]])
    t = np.arange(round(0.1 * rate)) / rate
    chirp = np.sin(2.0 * np.pi * (1000.0 * t + 60_000.0 * t**2))
    sound = np.zeros(round(0.345 * rate))
    sound[round(0.19 * rate) :][: chirp.size] = chirp
    u = np.array([0.6, 0.7, 0.0])
    u[2] = np.sqrt(1.0 - u @ u)
    heard = plane_wave(sound, places, u, rate)
    heard += 0.01 * np.random.default_rng(1).standard_normal(heard.shape)
    geometry = ArrayGeometry.model_validate(
        {"microphones": places.tolist(), "temperature_c": 20.0}
    )
    told = locate(heard, geometry, sample_rate_hz=rate).main_source()
    assert abs(told["bearing_deg"] - np.degrees(np.arctan2(0.7, 0.6))) < max(
        2.0, 3.0 * told["bearing_std_deg"]
    )


def test_a_click_of_ten_milliseconds_is_located():
    rate = 48_000
    places = 0.05 * np.array([[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0]])
    sound = np.random.default_rng(2).standard_normal(round(0.01 * rate))
    sound *= np.hanning(sound.size)
    heard = plane_wave(sound, places, np.array([0.6, 0.8, 0.0]), rate)
    heard += 0.01 * np.random.default_rng(3).standard_normal(heard.shape)
    told = locate(heard, places.tolist(), sample_rate_hz=rate).main_source()
    assert abs(told["bearing_deg"] - 53.13) < 6.0


def test_a_clip_shorter_than_the_travel_of_sound_is_refused_with_the_length_it_needs():
    places = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    heard = np.random.default_rng(1).standard_normal((3, 160))
    with pytest.raises(InputError, match=r"lasts 10 ms.*8.9\d* ms|at least"):
        locate(heard[:, :100], places, sample_rate_hz=16_000)
