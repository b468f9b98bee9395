"""A stream is heard as it comes, and each fault is named once."""

from __future__ import annotations

import io
import math
import re

import numpy as np
import pytest

import phonotaxis
from analysis.arrays.array_geometry import ArrayGeometry
from analysis.arrays.channel_fault import ChannelFault
from analysis.arrays.live_faults import LiveFaults
from analysis.arrays.live_hearing import (
    HeardStream,
    LiveHearing,
    listen_to,
    track_document,
)
from analysis.arrays.sound_stream import SoundBlock, SoundStream, StreamBrokenError
from systems.framework.input_error import InputError
from tests.analysis.arrays.plane_waves import RATE, SOUND_SPEED, SQUARE, plane_waves

Told = list[tuple[float, int, float]]
Named = list[tuple[float, str]]

BEARING = 35.0
# Measured to 0.2 mm, as by a drawing of a board.
GEOMETRY = ArrayGeometry(
    microphones=SQUARE, sound_speed=SOUND_SPEED, position_std_m=2e-4
)
FRIENDS = plane_waves(BEARING, 6.0)
FRIENDS.setflags(write=False)


def blocks_of(samples: np.ndarray, size: int = 320):
    for first in range(0, samples.shape[1], size):
        yield SoundBlock(samples[:, first : first + size])


def hear(samples, geometry=GEOMETRY, blocks=None) -> tuple[HeardStream, Told, Named]:
    """What was heard; (time, identity, bearing in deg) told; and faults by time."""
    stream = SoundStream(len(samples), RATE, blocks or blocks_of(samples))
    told: Told = []
    named: Named = []
    hearing = LiveHearing(stream, geometry, lambda fault, t: named.append((t, fault)))
    heard = listen_to(
        hearing,
        lambda step: told.extend(
            (step.sources.t_s, track.identity, math.degrees(track.bearing))
            for track in step.sources.tracks
        ),
    )
    return heard, told, named


def test_a_source_is_told_within_half_a_second_and_every_step_from_then_on():
    heard, told, named = hear(FRIENDS)
    assert (heard.status, heard.failed, named) == ("the stream has ended", False, [])
    assert heard.seconds == pytest.approx(6.0)
    times, identities, bearings = zip(*told, strict=True)
    assert times[0] <= 0.5
    np.testing.assert_allclose(np.diff(times), 0.1, atol=1e-9)
    assert set(identities) == heard.identities == {1}
    np.testing.assert_allclose(bearings, BEARING, atol=2.0)


def test_a_dead_channel_is_left_out_and_the_others_go_on():
    samples = FRIENDS.copy()
    samples[2] = 0.0
    heard, told, named = hear(samples)
    assert named == [(0.5, "channel 3: dead, and left out; check its microphone")]
    assert heard.faults == [fault for _, fault in named]
    assert not heard.failed
    late = [bearing for t, _, bearing in told if t > 1.0]
    assert len(late) > 40
    np.testing.assert_allclose(late, BEARING, atol=3.0)


def test_a_channel_that_dies_leaves_identity_and_bearing():
    samples = FRIENDS.copy()
    samples[1, 3 * RATE :] = 0.0
    heard, told, named = hear(samples)
    assert [t for t, _ in named] == [3.5]
    assert heard.identities == {1}
    np.testing.assert_allclose([b for t, _, b in told], BEARING, atol=3.0)
    assert told[-1][0] == pytest.approx(6.0)


def test_too_few_that_are_left_end_it():
    samples = FRIENDS.copy()
    samples[[1, 2]] = 0.0
    heard, told, named = hear(samples)
    assert heard.failed
    assert heard.status.startswith("stopped: channel 3: dead, and left out")
    assert heard.status.endswith("the remaining channels give no bearings")
    assert (told, len(named)) == ([], 1)


@pytest.mark.parametrize(
    ("order", "names"),
    [
        ([1, 0, 2, 3], "channels 1 and 2 or 3 and 4: exchanged"),
        ([0, 1, 2, 2], "channels 3 and 4: their samples are equal"),
    ],
)
def test_exchanged_and_copied_channels_end_it(order, names):
    heard, told, named = hear(FRIENDS[order])
    assert heard.failed
    assert heard.status.startswith(f"stopped: {names}")
    assert heard.faults == [heard.status.removeprefix("stopped: ")]
    assert not named
    assert max((t for t, _, _ in told), default=0.0) <= 5.0


@pytest.mark.parametrize("seconds", [2.0, 4.0])
def test_a_stream_that_ends_early_is_looked_at_as_well(seconds):
    heard, _, _ = hear(FRIENDS[[0, 1, 2, 2], : round(seconds * RATE)])
    assert heard.status.startswith("stopped: channels 3 and 4: their samples are equal")


@pytest.mark.parametrize(("factor", "told"), [(100.0, False), (50.0, True)])
def test_positions_in_other_units_are_named(factor, told):
    """In cm, the microphones are farther apart than `listen` accepts."""
    geometry = ArrayGeometry(
        microphones=tuple((factor * x, factor * y) for x, y in SQUARE),
        sound_speed=SOUND_SPEED,
    )
    remedy = r"give positions in m \(divide those in cm by 100"
    if not told:
        with pytest.raises(InputError, match=remedy):
            phonotaxis.listen(io.BytesIO(), geometry, sample_rate_hz=RATE, channels=4)
        return
    heard, _, _ = hear(FRIENDS, geometry)
    assert heard.failed
    assert re.search(remedy, heard.status)


def test_lost_samples_leave_out_their_channel():
    """37 samples of channel 2 are lost at 3 s: it is left out, and the others go on."""
    samples = FRIENDS[:, :-37].copy()
    samples[1, 3 * RATE :] = FRIENDS[1, 3 * RATE + 37 :]
    heard, told, named = hear(samples)
    ((time_s, fault),) = named
    assert fault.startswith("channel 2: 37 samples (2.31 ms) lost at 3.")
    assert fault.endswith("; channel 2 left out")
    assert 4.0 <= time_s <= 5.0
    assert (heard.failed, heard.identities) == (False, {1})
    late = [bearing for t, _, bearing in told if t > time_s + 0.5]
    np.testing.assert_allclose(late, BEARING, atol=3.0)


def test_a_late_channel_is_left_out():
    samples = FRIENDS.copy()
    samples[2] = np.roll(samples[2], 320)
    heard, told, named = hear(samples[:, 320:])
    ((time_s, fault),) = named
    assert fault.startswith("channel 3 20.")
    assert "late against channels 1, 2 and 4" in fault
    assert fault.endswith("; channel 3 left out")
    assert not heard.failed
    late = [bearing for t, _, bearing in told if t > time_s + 0.5]
    np.testing.assert_allclose(late, BEARING, atol=3.0)


def test_an_inverted_channel_is_turned_back():
    samples = FRIENDS * np.array([[1.0], [1.0], [1.0], [-1.0]], np.float32)
    heard, told, named = hear(samples)
    assert not heard.failed
    assert [fault[:19] for _, fault in named] == ["channel 4: inverted"]
    late = [bearing for t, _, bearing in told if t > 5.5]
    np.testing.assert_allclose(late, BEARING, atol=2.0)


def test_clocks_that_drift_apart_end_it():
    """By 60 us per second, which crosses the 0.1 m of the square in 5 s."""
    samples = plane_waves(BEARING, 20.0, drift=(0.0, 0.0, 60e-6, 60e-6))
    heard, told, _ = hear(samples)
    assert heard.failed
    said, _, speed = heard.status.partition(" by ")
    clocks = "channels 3 and 4: their clock drifts from that of channels 1 and 2"
    assert said == f"stopped: {clocks}"
    assert float(speed.partition(" us per second")[0]) == pytest.approx(60.0, rel=0.1)
    assert told[-1][0] < 15.0


def test_clipping_is_named_once():
    samples = np.clip(8.0 * FRIENDS, -1.0, 1.0)
    samples[1:] = FRIENDS[1:]
    heard, _, named = hear(samples)
    assert next(fault for _, fault in named).startswith("channel 1: clipped")
    assert sum("clipped" in fault for fault in heard.faults) == 1


@pytest.mark.parametrize("value", [math.nan, math.inf, 3e20])
def test_what_is_no_sample_counts_as_silence_and_is_named(value):
    samples = FRIENDS.copy()
    samples[2, 2 * RATE : 2 * RATE + 2_000 : 400] = value
    samples[2, 3 * RATE] = -1e30
    heard, told, named = hear(samples)
    assert len(named) == 1
    assert named[0][1].startswith(f"channel 3: a sample is {np.float32(value):g}, of a")
    assert heard.identities == {1}
    np.testing.assert_allclose([b for _, _, b in told], BEARING, atol=3.0)


def test_sources_begin_anew_after_a_gap():
    """What was missed nobody knows: the one who speaks now may be another one."""

    def broken():
        yield from blocks_of(FRIENDS[:, : 2 * RATE])
        yield SoundBlock(np.zeros((4, 0), np.float32), ("samples were lost",))
        first, *others = blocks_of(plane_waves(-100.0, 2.0, seed=2))
        yield SoundBlock(first.samples, ("samples were lost",), gap=True)
        yield from others

    heard, told, named = hear(FRIENDS, blocks=broken())
    assert named == [(2.0, "samples were lost")]
    assert heard.identities == {1, 2}
    times = {k: [t for t, identity, _ in told if identity == k] for k in (1, 2)}
    assert max(times[1]) == pytest.approx(2.0)
    assert min(times[2]) <= 2.6
    second = [bearing for _, identity, bearing in told if identity == 2]
    np.testing.assert_allclose(second, -100.0, atol=3.0)


def test_a_stream_that_breaks_off_says_so():
    def broken():
        yield from blocks_of(FRIENDS[:, :RATE])
        raise StreamBrokenError("the sound card was disconnected")

    heard, told, _ = hear(FRIENDS, blocks=broken())
    assert heard.failed
    assert heard.status == "stopped: the sound card was disconnected"
    assert told
    assert heard.seconds == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("channels", "rate", "complaint"),
    [
        (1, RATE, "is mono, but the array needs 4"),
        (3, RATE, "has 3 channels, but the array needs 4"),
        (
            6,
            RATE,
            "name the columns of its microphones.*'channels' of the geometry file",
        ),
        (4, 4_000, "has a sample rate of 4000 Hz; record at 8000 to 500000 Hz"),
    ],
)
def test_streams_of_another_array_are_refused_and_closed(channels, rate, complaint):
    closed = []
    stream = SoundStream(channels, rate, iter(()), lambda: closed.append(True))
    with pytest.raises(InputError, match=complaint):
        LiveHearing(stream, GEOMETRY)
    assert closed == [True]


def test_silence_has_no_sources_and_no_faults():
    """Of which 9 s would be long enough for all three looks."""
    silence = np.zeros((4, 10 * RATE), np.float32)
    heard, told, named = hear(np.hstack((silence, FRIENDS)))
    assert (named, heard.failed, heard.identities) == ([], False, {1})
    assert 10.0 < told[0][0] <= 10.5 + 1e-6


@pytest.mark.parametrize(("kind", "doubted"), [("geometry", True), ("moves", False)])
def test_a_fault_that_stays_limits_confidences(monkeypatch, kind, doubted):
    faults = [ChannelFault(kind, (), "a message")]

    def look(*_):
        while faults:
            yield faults.pop()

    monkeypatch.setattr(LiveFaults, "look", look)
    stream = SoundStream(4, RATE, blocks_of(FRIENDS), lambda: None)
    steps = list(LiveHearing(stream, GEOMETRY).steps())
    told = [line["confidence"] for step in steps for line in track_document(step)]
    assert max(told) <= 0.5 if doubted else max(told) > 0.9
