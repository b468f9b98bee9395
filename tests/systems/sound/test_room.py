"""Image sources of a room: against pyroomacoustics, mirrors by hand, and laws."""

from __future__ import annotations

import math

import numpy as np
import pyroomacoustics as pra
import pytest
import scipy.signal
from hypothesis import given, settings, strategies as st
from pydantic import ValidationError

from systems.sound.parameters import HEIGHT_M, RoomParameters
from systems.sound.room import room_images, room_impulse_responses

FS = 100_000
C = 340.0
SOURCE = (1.1, 0.6)
ROW = np.array([[-1.0, 0.4], [-1.0, 0.0], [-1.0, -0.4]])


def within(rows, low_hz, high_hz):
    sections = scipy.signal.butter(
        4, (low_hz, high_hz), "bandpass", fs=FS, output="sos"
    )
    return scipy.signal.sosfiltfilt(sections, np.asarray(rows, dtype=float))


def simulated(room, source, microphones, c):
    """The same by pyroomacoustics, from where its interpolation filter is centered."""
    absorption, _, order = room.walls(c)
    box = pra.ShoeBox(
        room.size_m, fs=FS, materials=pra.Material(absorption), max_order=order
    )
    box.set_sound_speed(c)
    box.add_source([*(source - room.corner), HEIGHT_M])
    heights = np.full(len(microphones), HEIGHT_M)
    box.add_microphone_array(np.vstack([(microphones - room.corner).T, heights]))
    box.compute_rir()
    half = pra.constants.get("frac_delay_length") // 2
    return [rows[0][half:] for rows in box.rir]


@pytest.mark.parametrize("time", [0.25, 0.4])
def test_as_pyroomacoustics_simulates(time):
    """Sample-accurate: 0.1 % of the signal is 0.01 sample at 3 kHz, or less.

    Within the band, for the other has a high-pass at 10 Hz in the end.
    """
    room = RoomParameters(corner_m=(-4.0, -3.0), reverberation_time_s=time)
    ours = room_impulse_responses(room, SOURCE, ROW, 343.0)
    for response, other in zip(ours, simulated(room, SOURCE, ROW, 343.0), strict=True):
        count = len(response) - 20
        a, b = within([response[:count], other[:count]], 200.0, 15_000.0)
        assert np.std(a - b) < 2e-3 * np.std(b)


def spectrum(response, frequencies):
    samples = np.arange(len(response))
    return np.exp(-2j * np.pi * np.outer(frequencies, samples) / FS) @ response


def test_first_reflections_are_mirror_images():
    """Six walls by hand, at 0.5 to 15 kHz: delays to 0.1 us, levels to 0.1 %."""
    room = RoomParameters(
        size_m=(6.0, 5.0, 3.0), corner_m=(-3.0, -1.0), absorption=0.4, maximum_order=1
    )
    x, y = SOURCE
    places = [(x, y, 0.3)]
    places += [(2 * wall - x, y, 0.3) for wall in (-3.0, 3.0)]
    places += [(x, 2 * wall - y, 0.3) for wall in (-1.0, 4.0)]
    places += [(x, y, 2 * wall - 0.3) for wall in (0.0, 3.0)]
    gains = np.array([1.0] + 6 * [math.sqrt(0.6)])
    frequencies = np.linspace(500.0, 15_000.0, 30)
    responses = room_impulse_responses(room, SOURCE, ROW, C)
    for response, microphone in zip(responses, ROW, strict=True):
        ranges = np.linalg.norm(np.array(places) - [*microphone, 0.3], axis=1)
        waves = np.exp(-2j * np.pi * np.outer(frequencies, ranges / C))
        expected = waves @ (gains / ranges)
        np.testing.assert_allclose(
            spectrum(response, frequencies),
            expected,
            atol=1e-3 * np.abs(expected).max(),
        )


inside = st.tuples(st.floats(-2.9, 2.9), st.floats(-1.9, 1.9))


@settings(max_examples=20)
@given(inside, inside)
def test_source_and_microphone_may_change_places(p, q):
    """Reciprocity, of the reflections."""

    room = RoomParameters(size_m=(6.0, 4.0, 2.5), maximum_order=6)
    there = room_impulse_responses(room, p, [q], C, direct=False)
    back = room_impulse_responses(room, q, [p], C, direct=False)
    np.testing.assert_allclose(there, back, atol=2e-5 * np.abs(there).max())


@settings(max_examples=20)
@given(inside, st.tuples(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0)))
def test_only_places_in_the_room_count(p, shift):
    room = RoomParameters(size_m=(6.0, 4.0, 2.5), maximum_order=5)
    moved = room.model_copy(update={"corner_m": tuple(room.corner + shift)})
    here = room_impulse_responses(room, p, ROW, C)
    there = room_impulse_responses(moved, np.add(p, shift), ROW + shift, C)
    np.testing.assert_allclose(there, here, atol=1e-5 * np.abs(here).max())


def decay_time(response, low_db, high_db):
    """Time for 60 dB by Schroeder's backward integral between two levels."""
    energy = np.cumsum(response[::-1] ** 2)[::-1]
    level = 10.0 * np.log10(energy[energy > 0] / energy[0])
    part = np.flatnonzero((level < -low_db) & (level > -high_db))
    return -60.0 / np.polyfit(part / FS, level[part], 1)[0]


def mean_decay_time(room):
    generator = np.random.default_rng(3)
    span = np.array(room.size_m[:2])
    times = []
    for _ in range(5):
        p, q = room.corner + generator.uniform(0.15, 0.85, (2, 2)) * span
        response = room_impulse_responses(room, p, [q], C)[0]
        times.append(decay_time(within(response, 500.0, 8_000.0), 5.0, 35.0))
    return np.mean(times)


@pytest.mark.parametrize(
    ("size", "time"), [((4.0, 4.0, 3.0), 0.4), ((5.0, 4.5, 4.0), 0.5)]
)
def test_compact_rooms_decay_as_sabine_says(size, time):
    room = RoomParameters(size_m=size, reverberation_time_s=time)
    assert mean_decay_time(room) == pytest.approx(time, rel=0.1)


@pytest.mark.parametrize(("time", "decay"), [(0.25, 0.25), (0.4, 0.45), (0.6, 0.72)])
def test_decay_of_the_flat_room_is_what_its_field_says(time, decay):
    room = RoomParameters(reverberation_time_s=time)
    assert mean_decay_time(room) == pytest.approx(decay, rel=0.06)


def test_images_within_the_reverberation_time_are_all_there():
    """One room's volume holds one image: 4/3 pi (c T)^3 / V of them."""
    room = RoomParameters(reverberation_time_s=0.4)
    images = room_images(room, C)
    places = images.signs * [2.0, 3.0, 1.0] + images.offsets
    near = np.count_nonzero(np.linalg.norm(places - [4.0, 3.0, 1.5], axis=1) < C * 0.4)
    assert near == pytest.approx(4 / 3 * math.pi * (C * 0.4) ** 3 / 147.0, rel=0.02)
    assert len(np.unique(places, axis=0)) == len(places)


def test_walls_that_absorb_all_leave_the_direct_sound():
    room = RoomParameters(absorption=1.0)
    assert not room_impulse_responses(room, SOURCE, ROW, C, direct=False).any()
    direct = room_impulse_responses(room, SOURCE, ROW, C)
    ranges = np.linalg.norm(np.subtract(SOURCE, ROW), axis=1)
    np.testing.assert_allclose(direct.sum(axis=1), 1.0 / ranges, rtol=1e-5)


def test_channel_sampled_later_hears_the_same_earlier():
    room = RoomParameters(maximum_order=4)
    late = np.array([0.0, 3e-6, -2e-6])
    plain = room_impulse_responses(room, SOURCE, ROW, C)
    shifted = room_impulse_responses(room, SOURCE, ROW, C, late=late)
    frequencies = np.linspace(500.0, 15_000.0, 10)
    for before, after, delay in zip(plain, shifted, late, strict=True):
        expected = spectrum(before, frequencies) * np.exp(
            2j * np.pi * frequencies * delay
        )
        np.testing.assert_allclose(
            spectrum(after, frequencies), expected, atol=2e-3 * np.abs(expected).max()
        )


def test_absorption_and_reverberation_time_are_sabines():
    expected, _ = pra.inverse_sabine(0.4, [7.0, 7.0, 3.0], C)
    absorption, time, order = RoomParameters(reverberation_time_s=0.4).walls(C)
    assert time == 0.4
    assert absorption == pytest.approx(expected)
    again, time, same_order = RoomParameters(absorption=absorption).walls(C)
    assert (again, same_order) == (absorption, order)
    assert time == pytest.approx(0.4)


def test_room_is_round_the_origin_unless_it_is_put_elsewhere():
    room = RoomParameters(size_m=(6.0, 4.0, 3.0))
    assert room.contains([[-2.9, 1.9], [2.9, -1.9]])
    assert not room.contains([[0.0, 0.0], [0.0, 2.1]])
    assert RoomParameters(corner_m=(0.0, 0.0)).contains([6.9, 6.9])


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"reverberation_time_s": 0.1}, r"room\.reverberation_time_s: 0\.1 .*0\.13 s"),
        ({"reverberation_time_s": 3.0}, r"room\.maximum_order: .*order 400"),
        ({"absorption": 0.01}, r"room\.maximum_order"),
    ],
)
def test_walls_that_cannot_be(fields, message):
    with pytest.raises(ValueError, match=message):
        RoomParameters(**fields).walls(C)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"size_m": (7.0, 7.0, 0.3)}, r"size_m.*ceiling"),
        ({"size_m": (7.0, 0.0, 3.0)}, "greater than"),
        ({"absorption": 0.0}, "greater than 0"),
    ],
)
def test_bad_parameters(fields, message):
    with pytest.raises(ValidationError, match=message):
        RoomParameters(**fields)
