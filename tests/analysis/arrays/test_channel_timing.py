"""Channels that are late, lose samples or die, made from plane waves in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.arrays.array_geometry import ArrayGeometry
from analysis.arrays.channel_changes import recorded_change
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
