"""Levels, rounding and clipping of the converter; its noise."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pydantic import ValidationError

from systems.framework.noise import frame_noise
from systems.sound.adc import convert
from systems.sound.parameters import MicArrayParameters

SILENT = np.zeros((3, 2500), dtype=np.float32)


def test_counts_per_pascal():
    """-23 dB re 1 V/Pa, 40 dB of gain, 512 counts for 1.65 V."""
    counts = MicArrayParameters().counts_per_pa
    assert counts == pytest.approx(10 ** (17 / 20) * 512 / 1.65, rel=1e-12)


def test_rounds_to_nearest_and_clips():
    parameters = MicArrayParameters()
    wanted = np.array([[0.4, 0.6, -0.4, -0.6, 511.4, 600.0, -511.6, -600.0]])
    pressure = (wanted / parameters.counts_per_pa).astype(np.float32)
    counts = convert(pressure, np.zeros_like(pressure), 0.0, parameters)
    np.testing.assert_array_equal(counts, [[0, 1, 0, -1, 511, 511, -512, -512]])
    assert counts.dtype == np.int16


def test_noise_alone_clips_as_sound_does():
    """Counts of 0.6 V of noise a unit, of 1.65 V full scale, 512 counts."""
    parameters = MicArrayParameters()
    units = np.array([[1.0, 2.0, 3.0, 9.0, -2.0, -3.0]], dtype=np.float32)
    noise_pa = 0.6 / 10 ** (17 / 20)
    wanted = [[186, 372, 511, 511, -372, -512]]  # 186.18 a unit
    for pressure in (None, np.zeros_like(units)):
        counts = convert(pressure, units, noise_pa, parameters)
        np.testing.assert_array_equal(counts, wanted)


@pytest.mark.parametrize("bits", [2, 8, 16])
def test_limits_follow_the_resolution(bits):
    parameters = MicArrayParameters(adc_bits=bits)
    pressure = np.array([[1e3, -1e3]], dtype=np.float32)
    counts = convert(pressure, np.zeros_like(pressure), 0.0, parameters)
    np.testing.assert_array_equal(counts, [[2 ** (bits - 1) - 1, -(2 ** (bits - 1))]])


def test_quantization_noise_is_a_twelfth():
    """Of a count squared, for a loud tone (Bennett)."""
    parameters = MicArrayParameters()
    exact = 500.0 * np.sin(0.7310 * np.arange(2500))[None]
    pressure = (exact / parameters.counts_per_pa).astype(np.float32)
    error = convert(pressure, np.zeros_like(pressure), 0.0, parameters) - exact
    assert np.mean(error**2) == pytest.approx(1 / 12, rel=0.1)


def test_share_of_a_clipped_tone():
    """|sin| exceeds s for a share 1 - 2 asin(s) / pi of the time."""
    parameters = MicArrayParameters()
    amplitude = 2.0 * parameters.full_scale / parameters.counts_per_pa
    pressure = (amplitude * np.sin(0.7310 * np.arange(2500)))[None].astype(np.float32)
    counts = convert(pressure, np.zeros_like(pressure), 0.0, parameters)
    clipped = np.mean((counts == 511) | (counts == -512))
    assert clipped == pytest.approx(1 - 2 * math.asin(0.5) / math.pi, abs=5e-3)


@pytest.mark.parametrize("pressure", [None, SILENT])
def test_level_of_the_noise(pressure):
    parameters = MicArrayParameters(adc_bits=16)
    noise_pa = 0.01
    counts = convert(pressure, frame_noise((3, 2500), 0, 0), noise_pa, parameters)
    # 7500 samples: the deviation's own error is 0.8 %.
    assert counts.std() == pytest.approx(noise_pa * parameters.counts_per_pa, rel=0.03)


def test_noise_is_white_and_its_own_in_every_channel():
    noise = np.concatenate([frame_noise((3, 2500), 3, k) for k in range(40)], axis=1)
    matrix = np.corrcoef(np.concatenate([noise[:, 1:], noise[:, :-1]]))
    # 100 000 samples: a correlation's error is 0.3 %.
    assert np.abs(matrix - np.eye(6)).max() < 0.015


def test_noise_follows_seed_and_tick():
    again = frame_noise((3, 2500), 1, 7)
    np.testing.assert_array_equal(frame_noise((3, 2500), 1, 7), again)
    for seed, tick in ((1, 8), (2, 7)):
        assert (
            abs(np.corrcoef(frame_noise((3, 2500), seed, tick)[0], again[0])[0, 1])
            < 0.1
        )


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("adc_bits", 17),
        ("snr_db_at_1m", math.nan),
    ],
)
def test_bad_parameters(field, value):
    with pytest.raises(ValidationError, match=field):
        MicArrayParameters(**{field: value})
