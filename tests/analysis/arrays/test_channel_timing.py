"""Channels that are late, lose samples or die, made from plane waves in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.arrays.array_geometry import ArrayGeometry
from analysis.arrays.channel_changes import (
    ChannelDelays,
    recorded_change,
    slipping_channels,
)
from analysis.arrays.channel_timing import LagSearch, unaligned_channels
from tests.analysis.arrays.plane_waves import RATE, SOUND_SPEED, SQUARE, plane_waves

HEARD = plane_waves(35.0, 8.0).astype(np.float64)
HEARD.setflags(write=False)
HALF = 4 * RATE


def search(places=SQUARE) -> LagSearch:
    geometry = ArrayGeometry(microphones=places, sound_speed=SOUND_SPEED)
    numbers = range(len(places))
    return LagSearch.of(geometry.known, float(RATE), None, numbers)


def late(channels, count):
    samples = HEARD.copy()
    for k in channels:
        samples[k] = np.roll(samples[k], count)
    return samples[:, count:]


def lost(channels, count):
    samples = HEARD[:, : HEARD.shape[1] - count].copy()
    for k in channels:
        samples[k, HALF:] = HEARD[k, HALF + count :]
    return samples


def test_the_delays_of_a_plane_wave():
    found = search()
    lags = found.lags([HEARD[:, :RATE]], 0.25)
    turn = np.radians(35.0)
    later = -(np.array(SQUARE) @ [np.cos(turn), np.sin(turn)]) / SOUND_SPEED
    i, j = found.pairs.T
    np.testing.assert_allclose(lags, later[j] - later[i], atol=3e-6)


def test_nothing_is_late_in_a_sound_recording():
    assert unaligned_channels(HEARD, search()) is None
    assert recorded_change(HEARD, search()) is None


@pytest.mark.parametrize("milliseconds", [2.0, 10.0, 50.0, 240.0])
@pytest.mark.parametrize("channels", [(2, 3), (1,)])
def test_late_cards_and_recorders(milliseconds, channels):
    fault = unaligned_channels(
        late(channels, round(1e-3 * milliseconds * RATE)), search()
    )
    assert fault is not None
    assert (fault.kind, fault.channels) == ("unaligned", channels)
    # The direction is unknown, so that the array's 0.4 ms remain.
    assert fault.seconds == pytest.approx(1e-3 * milliseconds, abs=4e-4)
    assert " late against channels 1" in fault.message


def test_a_channel_that_begins_early():
    fault = unaligned_channels(late((0, 1, 3), 160), search())
    assert fault is not None
    assert fault.channels == (2,)
    assert " early against channels 1, 2 and 4" in fault.message


@pytest.mark.parametrize("scale", [0.5, 0.1])
def test_positions_that_are_too_small_are_not_lateness(scale):
    """One wave front explains all delays."""
    places = tuple((scale * x, scale * y) for x, y in SQUARE)
    assert unaligned_channels(HEARD, search(places)) is None


def arrivals_at(places, direction, late_s):
    """Delays of a plane wave for the pairs of a search, with some channels late."""
    t = -np.array(places) @ direction / SOUND_SPEED
    for k, by_s in late_s.items():
        t[k] += by_s
    found = search(tuple(map(tuple, places)))
    i, j = found.pairs.T
    return found, t[j] - t[i]


LARGE = 0.75 * np.array([[1, 1, 0], [-1, 1, 0.2], [-1, -1, 0], [1, -1, 0.3]])


@pytest.mark.parametrize("turn_deg", range(0, 360, 30))
def test_a_recorder_of_a_large_array_is_late_by_little(turn_deg, monkeypatch):
    """By 10 ms, where sound takes 6 ms along the array."""
    turn = np.radians(turn_deg)
    found, lags = arrivals_at(LARGE, [np.cos(turn), np.sin(turn), 0.0], {1: 0.01})
    monkeypatch.setattr(LagSearch, "lags", lambda *_: lags)
    fault = unaligned_channels(np.ones((4, 2 * RATE)), found)
    if np.abs(lags).max() > 1.15 * found.shape.aperture_m / SOUND_SPEED + 1e-4:
        assert fault is not None
        assert fault.channels == (1,)
        # The direction is known only from the other three.
        assert fault.seconds == pytest.approx(0.01, abs=3e-3)
    # One wrong peak does not matter, for other references hear the same.
    lags[0] = 0.0
    again = unaligned_channels(np.ones((4, 2 * RATE)), found)
    assert (again is None) == (fault is None)


@pytest.mark.parametrize("scale", [0.8, 0.5, 0.4, 0.3048])
def test_a_large_array_in_other_units_is_not_late(scale, monkeypatch):
    for turn in np.radians(range(0, 360, 30)):
        _, lags = arrivals_at(LARGE, [np.cos(turn), np.sin(turn), 0.0], {})
        monkeypatch.setattr(LagSearch, "lags", lambda *_, lags=lags: lags)
        places = tuple(map(tuple, scale * LARGE))
        assert unaligned_channels(np.ones((4, 2 * RATE)), search(places)) is None


def test_one_sample_lost_at_48_khz_among_echoes():
    """Delays of stretches scatter by a quarter of the step."""
    rng = np.random.default_rng(1)
    places = tuple((0.05 * np.cos(a), 0.05 * np.sin(a)) for a in np.arange(6.0))
    geometry = ArrayGeometry(microphones=places, sound_speed=SOUND_SPEED)
    found = LagSearch.of(geometry.known, 48_000.0, None, range(6))
    t_s = np.arange(0.2, 8.0, 0.33)
    i, j = found.pairs.T
    lost_s = np.outer(t_s > 4.0, np.eye(6)[2]) / -48_000.0
    lags = lost_s[:, j] - lost_s[:, i] + rng.normal(0.0, 5e-6, (t_s.size, i.size))
    delays = ChannelDelays(t_s, lags, np.zeros((t_s.size, 6)))
    fault = slipping_channels(delays, found)
    assert fault is not None
    assert fault.channels == (2,)
    assert "1 sample (0.02" in fault.message
    assert "lost at 4" in fault.message
    still = ChannelDelays(t_s, lags - lost_s[:, j] + lost_s[:, i], delays.levels_db)
    assert slipping_channels(still, found) is None


@pytest.mark.parametrize("rate", [48_000.0, 100_000.0])
@pytest.mark.parametrize("speed", [0.15, 0.3, 1.0])
def test_a_source_that_drives_away_from_three_microphones(speed, rate):
    """It sounds for 0.5 s, is silent for 1.5 s, and sounds again farther away."""
    places = np.array([[0.0, 0.4], [0.0, 0.0], [0.0, -0.4]])
    geometry = ArrayGeometry(
        microphones=tuple(map(tuple, places.tolist())), sound_speed=SOUND_SPEED
    )
    found = LagSearch.of(geometry.known, rate, None, range(3))
    t_s = np.concatenate([begin + np.arange(0.04, 0.5, 0.08) for begin in (0.0, 2.0)])
    source = np.column_stack([1.4 + speed * t_s, np.zeros(t_s.size)])
    paths = np.linalg.norm(source[:, np.newaxis] - places, axis=2)
    i, j = found.pairs.T
    lags = (paths[:, j] - paths[:, i]) / found.c
    delays = ChannelDelays(t_s, lags, np.zeros((t_s.size, 3)))
    assert slipping_channels(delays, found) is None


@pytest.mark.parametrize("count", [1, 2, 37, 1024])
@pytest.mark.parametrize("k", [0, 1, 3])
def test_lost_samples_are_counted_and_timed(count, k):
    fault = recorded_change(lost((k,), count), search())
    assert fault is not None
    assert (fault.kind, fault.channels) == ("slipped", (k,))
    word = "sample" if count == 1 else "samples"
    assert fault.message.startswith(f"channel {k + 1}: {count} {word} (")
    time_s = float(fault.message.partition(" lost at ")[2].partition(" s;")[0])
    assert time_s == pytest.approx(4.0, abs=0.5)


def test_a_source_that_changes_its_place_loses_no_samples():
    other = plane_waves(-100.0, 4.0, seed=2)
    samples = np.hstack((HEARD[:, :HALF], other))
    assert recorded_change(samples, search()) is None


@pytest.mark.parametrize("first", [True, False])
@pytest.mark.parametrize(
    ("level", "seen"), [(0.05, "without the sound"), (0, "silent")]
)
def test_a_channel_that_is_dead_for_half_of_the_time(first, level, seen):
    samples = HEARD.copy()
    rng = np.random.default_rng(1)
    part = slice(0, HALF) if first else slice(HALF, None)
    samples[0, part] = level * rng.standard_normal(HALF)
    fault = recorded_change(samples, search())
    assert fault is not None
    assert (fault.kind, fault.channels) == ("dead", (0,))
    assert fault.message.startswith(f"channel 1: dead, {seen}")
    assert ("until" if first else "from") in fault.message
    word = "until " if first else "from "
    time_s = float(fault.message.partition(word)[2].partition(" s")[0])
    assert time_s == pytest.approx(4.0, abs=0.5)


def test_silence_after_a_sound_is_no_fault():
    rng = np.random.default_rng(1)
    samples = HEARD.copy()
    samples[:, HALF:] = 1e-4 * rng.standard_normal((4, HALF))
    assert recorded_change(samples, search()) is None
