"""Two microphones measure the angle between a source and their axis."""

from __future__ import annotations

import math

import numpy as np
import pytest

from analysis.arrays.array_geometry import ArrayGeometry
from analysis.arrays.live_faults import LiveFaults
from phonotaxis import locate

RATE, C, APART = 16_000, 343.0, 0.1
GEOMETRY = ArrayGeometry(
    microphones=((0.0, -APART / 2), (0.0, APART / 2)), sound_speed=C
)


def heard(angle_deg, *, snr_db=25.0, seconds=3.0, seed=0):
    """(2, k) syllables of noise from the angle to the axis from 1 to 2, +y."""
    rng = np.random.default_rng(seed)
    count = round(seconds * RATE)
    f = np.fft.rfftfreq(count, 1.0 / RATE)
    t = np.arange(count) / RATE
    sound = rng.standard_normal(count) * np.maximum(np.sin(2 * np.pi * 2.3 * t), 0.02)
    spectrum = np.fft.rfft(sound) * (f > 300.0) * (f < 6_000.0)
    earlier = 0.5 * APART * math.cos(math.radians(angle_deg)) / C
    turn = np.exp(2j * np.pi * f * earlier)
    rows = np.fft.irfft(np.array([spectrum / turn, spectrum * turn]), count)
    noise = rows.std() * 10.0 ** (-snr_db / 20.0)
    rows += noise * rng.standard_normal(rows.shape)
    return 0.3 * rows / np.abs(rows).max()


@pytest.mark.parametrize("angle_deg", [30.0, 70.0, 85.0, 115.0, 150.0])
def test_the_angle_to_the_axis_with_both_sides(angle_deg):
    result = locate(heard(angle_deg), GEOMETRY, sample_rate_hz=RATE)
    summary = result.main_source()
    bearing, std = summary["bearing_deg"], summary["bearing_std_deg"]
    # Ahead of the row is +x, and the axis is +y.
    assert abs(bearing - (90.0 - angle_deg)) < max(3.0 * std, 1.0)
    assert std < 6.0
    assert summary["ambiguity"] == "front_back"
    other = summary["alternatives"][0]["bearing_deg"]
    assert (other + bearing) % 360.0 == pytest.approx(180.0)
    assert summary["observable"] == ["bearing"]
    assert summary["faults"] == []


def test_a_slanted_pair_claims_no_bearing():
    slanted = ArrayGeometry(microphones=((0, 0, 0), (0.06, 0, 0.08)), sound_speed=C)
    summary = locate(heard(60.0), slanted, sample_rate_hz=RATE).main_source()
    assert summary["frames_heard"] > 0
    assert summary["observable"] == []


def test_a_dead_channel_of_two_is_found_live():
    samples = heard(60.0).astype(np.float32)
    samples[1] *= 1e-4
    looks = LiveFaults(GEOMETRY, RATE)
    try:
        found = next(looks.look(samples))
    finally:
        looks.close()
    assert (found.kind, found.channels) == ("dead", (1,))
