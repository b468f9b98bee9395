"""Each reason for which an estimate has no range, on the ports and in a table."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.random import Generator, Philox

from diagrams import load_scenario, simulate
from phonotaxis.testing import Bench
from systems.framework.signals import AudioFrame
from systems.hearing import localize
from systems.hearing.multilateration import locate_source
from systems.hearing.source_fix import (
    NO_PLACE,
    NOTHING_HEARD,
    PLANE_WAVE,
    RANGED,
    REJECTED,
    TOO_FEW_MICROPHONES,
    UNCERTAIN,
    range_status,
)
from systems.hearing.spherical_interpolation import near_or_far
from systems.hearing.tdoa_estimator import TDOAEstimator
from systems.sound.array_shape import ArrayShape

FS, N, C = 100_000.0, 2500, 340.0
ROW = np.array([[0.0, 0.4], [0.0, 0.0], [0.0, -0.4]])
CROSS = np.array([[0.0, 0.0], [0.25, 0.0], [0.0, 0.25], [-0.25, 0.0], [0.0, -0.25]])


def chirp(t):
    """0.5-8 kHz in 25 ms, again and again."""
    sweep = np.mod(t, 0.025)
    return np.sin(2 * np.pi * (500.0 + 150_000.0 * sweep) * sweep)


def noise(seed=0):
    return Generator(Philox(key=seed)).standard_normal((3, N))


def sound_with(delays):
    """(3, N) a chirp that reaches the microphones so much later, s."""
    t = 0.3 + np.arange(N) / FS
    return np.array([chirp(t - delay) for delay in delays]) + 0.003 * noise()


def sound_at(x, y):
    return sound_with(np.linalg.norm(ROW - [x, y], axis=1) / C)


class Ears:
    """An estimator that hears one frame after the other."""

    def __init__(self):
        self.bench = Bench(TDOAEstimator())

    def read(self, name):
        return float(self.bench.output(name)[0])

    def hear(self, rows):
        """Status of the range after a frame."""
        counts = np.round(100.0 * np.asarray(rows)).astype(np.int16)
        self.bench.tick(audio=AudioFrame(counts, 512, FS, 0.025))
        status = self.read("range_status")
        assert self.read("range_valid") == (status == RANGED)
        assert self.read("detected") == (status not in {NOTHING_HEARD, REJECTED})
        return status


@pytest.mark.drake
def test_before_the_first_frame_nothing_is_heard():
    assert Ears().read("range_status") == NOTHING_HEARD


@pytest.mark.drake
def test_a_sound_that_ends_is_heard_no_longer():
    ears = Ears()
    assert ears.hear(sound_at(1.5, 0.5)) == RANGED
    assert ears.hear(0.1 * noise(1)) == NOTHING_HEARD


@pytest.mark.drake
def test_a_silent_channel_is_no_sound():
    """The estimator then remembers the last frame, which had a sound."""
    ears, rows = Ears(), sound_at(1.5, 0.5)
    assert ears.hear(rows) == RANGED
    rows[1] = 0.0
    assert ears.hear(rows) == NOTHING_HEARD


@pytest.mark.drake
def test_a_plane_wave():
    """Curved the wrong way: the middle microphone hears it late."""
    assert Ears().hear(sound_with([0.0, 2e-4, 2e-4])) == PLANE_WAVE


@pytest.mark.drake
def test_delays_that_no_place_has():
    """From the second microphone to the third it takes 3 mm more than their distance.

    So it does by noise if the source stands between them.
    """
    assert Ears().hear(sound_with([0.0, -0.2 / C, 0.203 / C])) == NO_PLACE


@pytest.mark.drake
def test_a_range_that_is_too_uncertain(monkeypatch):
    monkeypatch.setattr(localize, "_LARGEST_RANGE_STD", 1e-5)
    assert Ears().hear(sound_at(1.5, 0.5)) == UNCERTAIN


@pytest.mark.drake
def test_a_source_too_near_is_rejected():
    assert Ears().hear(sound_at(0.1, 0.0)) == REJECTED
    assert Ears().hear(sound_at(0.4, 0.0)) == RANGED


@pytest.mark.drake
def test_an_estimate_too_uncertain_is_rejected(monkeypatch):
    monkeypatch.setattr(localize, "_LARGEST_BEARING_STD", 1e-8)
    assert Ears().hear(sound_at(1.5, 0.5)) == REJECTED


def located(places, p_AS, std):
    """The source by exact delays of a stated standard deviation, s."""
    shape = ArrayShape.of(places)
    ranges = np.linalg.norm(shape.p_AM - p_AS, axis=1)
    covariance = std**2 * (np.eye(shape.count - 1) + 1.0)
    return locate_source((ranges[1:] - ranges[0]) / C, covariance, shape, C)


@pytest.mark.parametrize(
    ("places", "p_AS", "std", "expected"),
    [
        (ROW, (2.0, 0.5), 1e-8, RANGED),
        (ROW, (30.0, 5.0), 1e-5, UNCERTAIN),
        (CROSS, (2.0, 0.5), 1e-8, RANGED),
        (CROSS, (30.0, 5.0), 1e-5, UNCERTAIN),
        # In space a triangle measures two angles and has nothing left.
        (np.pad(CROSS[1:4], ((0, 0), (0, 1))), (1.0, 1.0, 0.8), 1e-8,
         TOO_FEW_MICROPHONES),
    ],
)  # fmt: skip
def test_status_of_a_fit(places, p_AS, std, expected):
    fix = located(places, np.array(p_AS), std)
    assert fix.range_status == expected
    assert fix.range_valid == (expected == RANGED)
    assert fix.without_range().range_status == (
        UNCERTAIN if expected == RANGED else expected
    )


def test_a_wave_that_is_curved_the_wrong_way_fits_no_finite_range():
    shape = ArrayShape.of(CROSS)
    u = np.array([math.cos(0.3), math.sin(0.3)])
    p = shape.p_AM
    times = (-p @ u - 0.1 * (np.sum(p * p, axis=1) - (p @ u) ** 2)) / C
    fix = locate_source(times[1:] - times[0], 1e-14 * np.eye(4), shape, C)
    assert fix.range_status == PLANE_WAVE


@pytest.mark.parametrize(
    ("distance", "error", "expected"),
    [
        (1.5, 0.0, RANGED),
        (6.0, 0.0, PLANE_WAVE),  # beyond 4 m
        (2.5, -0.02, NO_PLACE),  # the sum of the differences changes its sign
    ],
)
def test_status_of_spherical_interpolation(distance, error, expected):
    p_RM = CROSS[1:]
    d = np.linalg.norm(p_RM - [distance, 0.0], axis=1) - distance + error
    bearing, place, status = near_or_far(p_RM, d)
    assert status == expected
    assert (place is None) == (status != RANGED)
    assert bearing == pytest.approx(0.0, abs=0.02)


def test_too_few_microphones_come_before_everything_else():
    assert range_status(math.nan, enough=False) == TOO_FEW_MICROPHONES
    assert range_status(math.nan) == NO_PLACE
    assert range_status(0.0) == PLANE_WAVE
    assert range_status(0.5, 1.0, 1.0) == UNCERTAIN
    assert range_status(0.5, 0.9, 1.0) == RANGED


@pytest.mark.parametrize(
    "engine", [pytest.param("drake", marks=pytest.mark.drake), "compiled"]
)
@pytest.mark.parametrize("hearing", ["ideal", "audio"])
def test_the_table_says_why(engine, hearing):
    changes = {"hearing": hearing, "engine": engine, "duration_s": 2.5}
    columns = simulate(load_scenario("default", changes)).columns
    status = columns["range_status"]
    np.testing.assert_array_equal(columns["range_valid"] > 0.5, status == RANGED)
    heard = (status != NOTHING_HEARD) & (status != REJECTED)
    np.testing.assert_array_equal(columns["detected"] > 0.5, heard)
    assert {NOTHING_HEARD, RANGED} <= set(status)
