"""Clocks that drift apart are told from sources that move."""

from __future__ import annotations

import numpy as np
import pytest
import soundfile

from analysis.arrays.array_geometry import ArrayGeometry
from analysis.arrays.clock_drift import clock_drift, common_lags, recording_drift
from phonotaxis import locate
from systems.framework.input_error import InputError
from tests.analysis.arrays.plane_waves import RATE, SOUND_SPEED, SQUARE, plane_waves

PLACES = np.array(SQUARE)
# What sound takes along a side of the square, s.
SIDE_S = 0.1 / SOUND_SPEED
TIMES = np.array([0.5 * k for k in range(40)])


def test_delays_of_a_stretch_are_those_of_the_plane_wave():
    lags = common_lags(plane_waves(0.0, 1.0), RATE)
    np.testing.assert_allclose(lags, [SIDE_S, SIDE_S, 0.0], atol=0.5 / RATE)


def test_channels_without_common_sound_have_no_delay():
    rng = np.random.default_rng(3)
    assert np.isnan(common_lags(rng.standard_normal((4, RATE)), RATE)).all()


def drifting(slopes, around=0.0, seed=1):
    rng = np.random.default_rng(seed)
    at = np.clip(around * rng.standard_normal((TIMES.size, 1)), -1.0, 1.0)
    return np.outer(TIMES, slopes) + SIDE_S * at


@pytest.mark.parametrize("around", [0.0, 1.0])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_drift_is_told_with_its_channels(around, sign):
    """Talkers to and fro change delays as well, but not for good."""
    lags = drifting(sign * np.array([0.0, 80e-6, 80e-6]), around)
    fault = clock_drift(TIMES, lags, PLACES, SOUND_SPEED)
    assert fault is not None
    assert fault.channels == (2, 3)
    told = float(fault.message.partition(" by ")[2].partition(" us")[0])
    assert told == pytest.approx(80.0, rel=0.2)


@pytest.mark.parametrize(
    "lags",
    [
        drifting([0.0, 0.0, 0.0], 1.0),
        # A source that walks by, from one end of what a side allows to the other.
        np.outer(np.linspace(-1.0, 1.0, TIMES.size), [SIDE_S, SIDE_S, 0.0]),
        # A channel that is late by far, always alike.
        np.tile([0.0, 0.01, 0.0], (TIMES.size, 1)),
        # Peaks of noise.
        np.random.default_rng(5).uniform(-0.05, 0.05, (TIMES.size, 3)),
        # And such as happen to grow.
        np.random.default_rng(6).uniform(-0.02, 0.02, (TIMES.size, 3))
        + 1e-3 * TIMES[:, None],
        np.full((TIMES.size, 3), np.nan),
    ],
)
def test_what_is_no_drift(lags):
    assert clock_drift(TIMES, lags, PLACES, SOUND_SPEED) is None


def test_locate_refuses_a_recording_of_two_clocks(tmp_path):
    samples = plane_waves(20.0, 10.0, drift=(0.0, 100e-6, 0.0, 0.0))
    fault = recording_drift(samples, RATE, PLACES, SOUND_SPEED)
    assert fault is not None
    assert fault.channels == (1,)
    path = tmp_path / "two_clocks.wav"
    soundfile.write(path, samples.T, RATE)
    geometry = ArrayGeometry(microphones=SQUARE, sound_speed=SOUND_SPEED)
    with pytest.raises(InputError, match="channel 2: its clock drifts from"):
        locate(path, geometry)


def test_one_clock_is_no_fault():
    assert recording_drift(plane_waves(20.0, 6.0), RATE, PLACES, SOUND_SPEED) is None
