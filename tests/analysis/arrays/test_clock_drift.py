"""Clocks that drift apart are told from sources that move."""

from __future__ import annotations

import numpy as np
import pytest
import soundfile

from analysis.arrays.array_geometry import ArrayGeometry
from analysis.arrays.clock_drift import clock_drift, common_lags, recording_drift
from analysis.arrays.wave_fronts import wave_front_misfits
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


def arrivals_of(path, places):
    """(k, n - 1) delays at microphones of a source at (k, 3) places, s."""
    p = np.pad(places, ((0, 0), (0, 3 - places.shape[1])))
    arrivals = np.linalg.norm(path[:, np.newaxis] - p, axis=2) / SOUND_SPEED
    return arrivals[:, 1:] - arrivals[:, :1]


def ring(count, diameter):
    turn = 2.0 * np.pi * np.arange(count) / count
    return 0.5 * diameter * np.stack((np.cos(turn), np.sin(turn)), axis=1)


ARRAYS = {
    "square of 4.6 cm": ring(4, 0.065),
    "row of 4": np.array([[x, 0.0] for x in (-0.075, -0.025, 0.025, 0.075)]),
    "circle of 8": ring(8, 0.2),
    "triangle": ring(3, 0.115),
    "tetrahedron": 0.06
    * np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1.0]]),
    "square of 1 m": ring(4, 1.0),
}


def walk(t_s, speed):
    x = speed * (t_s - t_s.mean())
    return np.stack((x, np.ones_like(x), np.full_like(x, 0.2)), axis=1)


def circling(t_s, deg_per_s, far=1.5):
    turn = np.radians(deg_per_s) * t_s
    at = (far * np.cos(turn), far * np.sin(turn), np.full_like(turn, 0.2))
    return np.stack(at, axis=1)


def rounded(lags, seed=0):
    """To samples of 16 kHz, and a tenth of them echoes."""
    rng = np.random.default_rng(seed)
    lags = np.rint(lags * RATE) / RATE
    echo = rng.random(lags.shape) < 0.1
    return np.where(echo, rng.uniform(-0.01, 0.01, lags.shape), lags)


@pytest.mark.parametrize("name", ARRAYS)
@pytest.mark.parametrize("seconds", [10.0, 30.0])
def test_a_source_that_moves_is_no_drift(name, seconds):
    places = ARRAYS[name]
    t_s = np.arange(0.25, seconds, 0.5)
    paths = [walk(t_s, speed) for speed in (0.5, 1.0, 1.5)]
    paths += [circling(t_s, speed) for speed in (5.0, -10.0, 20.0, 45.0)]
    for seed, path in enumerate(paths):
        lags = rounded(arrivals_of(path, places), seed)
        assert clock_drift(t_s, lags, places, SOUND_SPEED) is None


def test_a_sine_of_delays_is_no_drift():
    """All delays are physical, although a line through them leaves the array."""
    t_s = np.arange(0.0, 9.1, 0.5)
    x = ARRAYS["row of 4"][:, 0]
    lags = np.outer(np.cos(np.radians(20.0 * t_s)), -(x[1:] - x[0]) / 343.0)
    assert clock_drift(t_s, lags, ARRAYS["row of 4"], 343.0) is None


@pytest.mark.parametrize("name", ["square of 4.6 cm", "row of 4", "circle of 8"])
@pytest.mark.parametrize(("seconds", "ppm"), [(20.0, 50.0), (60.0, 20.0)])
@pytest.mark.parametrize("moves", [False, True])
def test_a_drift_is_found_whether_or_not_the_source_moves(name, seconds, ppm, moves):
    places = ARRAYS[name]
    t_s = np.arange(0.25, seconds, 0.5)
    path = circling(t_s, 10.0 if moves else 0.0)
    for channel in range(1, len(places)):
        lags = arrivals_of(path, places)
        lags[:, channel - 1] += 1e-6 * ppm * (-1) ** channel * t_s
        fault = clock_drift(t_s, rounded(lags), places, SOUND_SPEED)
        assert fault is not None
        if not moves:
            assert fault.channels == (channel,)
            assert f"by {ppm:.0f} us per second" in fault.message


def test_delays_too_long_for_any_source_are_a_drift():
    """Of three microphones, where a source explains all delays up to that."""
    places = ARRAYS["triangle"]
    t_s = np.arange(0.25, 20.0, 0.5)
    lags = arrivals_of(circling(t_s, 0.0), places)
    lags[:, 1] -= 50e-6 * t_s
    assert clock_drift(t_s[:12], lags[:12], places, SOUND_SPEED) is None
    fault = clock_drift(t_s, lags, places, SOUND_SPEED)
    assert fault is not None
    assert fault.channels == (2,)


@pytest.mark.parametrize("count", [2, 3])
def test_a_drift_that_a_source_explains_is_named_as_a_motion_or_a_drift(count):
    """1 ms of 20 s, of the 2.9 ms that sound takes along 1 m."""
    places = ring(count, 1.0)
    t_s = np.arange(0.25, 20.0, 0.5)
    path = circling(t_s, 0.0)[:, [1, 0, 2]]
    lags = arrivals_of(path, places)
    lags[:, 0] += 50e-6 * t_s
    fault = clock_drift(t_s, rounded(lags), places, SOUND_SPEED)
    assert fault is not None
    assert (fault.kind, fault.channels) == ("moves", (1,))
    assert "by 50 us per second: the source moves, or the clock drifts" in fault.message
    # Without a drift there is nothing to say, and neither is there of more microphones.
    rest = rounded(arrivals_of(path, places))
    assert clock_drift(t_s, rest, places, SOUND_SPEED) is None


@pytest.mark.parametrize("name", ARRAYS)
@pytest.mark.parametrize("far", [0.8, 1.5, 20.0])
def test_wave_fronts_of_sources_leave_nothing(name, far):
    places = ARRAYS[name]
    lags = arrivals_of(circling(np.arange(12.0), 30.0, far), places)
    left = wave_front_misfits(lags, places, SOUND_SPEED)
    np.testing.assert_allclose(left, 0.0, atol=3e-6)
    lags[3, 1] = np.nan
    left = wave_front_misfits(lags, places, SOUND_SPEED)
    assert np.isnan(left[3, 2])
    np.testing.assert_allclose(np.nan_to_num(left), 0.0, atol=3e-6)


def test_what_a_row_cannot_have_is_left():
    """A third too much at the ends: the plane wave along the row is the best."""
    x = ARRAYS["row of 4"][:, 0]
    lags = -1.3 * (x[1:] - x[0])[np.newaxis] / SOUND_SPEED
    left = wave_front_misfits(lags, ARRAYS["row of 4"], SOUND_SPEED)
    np.testing.assert_allclose(left[0], -0.3 * x / SOUND_SPEED, atol=2e-6)


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
