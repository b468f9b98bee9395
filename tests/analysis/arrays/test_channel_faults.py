"""Faults that are put into sound recordings, and recordings without any."""

from __future__ import annotations

import math
import warnings

import numpy as np
import pytest

from analysis.arrays.array_budget import ArrayBudget
from analysis.arrays.array_geometry import KnownArray
from analysis.arrays.channel_faults import find_channel_faults
from systems.sound.array_shape import ArrayShape

FS, C, SECONDS = 16_000, 340.0, 3.0
ROW = ArrayShape.of([[0.0, 0.4], [0.0, 0.0], [0.0, -0.4]])
SQUARE = ArrayShape.of([[0.1, 0.1], [-0.1, 0.1], [-0.1, -0.1], [0.1, -0.1]])
FIVE = ArrayShape.of(
    [[0.2, 0.3, 0], [0.3, -0.1, 0], [-0.1, -0.3, 0.1], [-0.3, 0.1, 0], [0, 0.05, 0.2]]
)


def place(shape, bearing_deg, distance):
    angle = math.radians(bearing_deg)
    u = np.array([math.cos(angle), math.sin(angle), 0.2])[: shape.dimension]
    return distance * u / np.linalg.norm(u)


def recording(shape, p_AS, *, snr_db=20.0, seed=0):
    """(n, samples) syllables of noise of 0.3-6 kHz, its level in steps of 16 bits."""
    generator = np.random.default_rng(seed)
    count = round(SECONDS * FS)
    f = np.fft.rfftfreq(count, 1 / FS)
    spectrum = np.fft.rfft(generator.standard_normal(count))
    spectrum *= (f > 300) & (f < 6000)
    t = np.arange(count) / FS
    syllables = np.maximum(np.sin(2 * np.pi * 2.3 * t), 0.02)
    spectrum = np.fft.rfft(np.fft.irfft(spectrum, count) * syllables)
    ranges = np.linalg.norm(shape.p_AM - p_AS, axis=1)
    rows = np.array(
        [np.fft.irfft(spectrum * np.exp(-2j * np.pi * f * r / C) / r) for r in ranges]
    )
    rows += rows.std() * 10 ** (-snr_db / 20) * generator.standard_normal(rows.shape)
    return np.rint(rows * (0.3 * 2**15 / np.abs(rows).max())) / 2**15


def found_faults(samples, shape, position_std=0.0005, gain_std_db=0.0):
    budget = ArrayBudget(position_std**2 * np.eye(shape.p_AM.size), 0.0, 0.0)
    array = KnownArray(shape, C, budget, gain_std_db=gain_std_db)
    return find_channel_faults(samples, array, sample_rate_hz=FS)


def faults(samples, shape=FIVE):
    found = found_faults(samples, shape)
    return [(fault.kind, fault.channels) for fault in found]


@pytest.mark.parametrize("shape", [ROW, SQUARE, FIVE])
@pytest.mark.parametrize("distance", [0.6, 2.0])
@pytest.mark.parametrize("snr_db", [5.0, 30.0])
def test_nothing_is_wrong_with_a_sound_recording(shape, distance, snr_db):
    for seed, bearing in enumerate((-60.0, 0.0, 25.0)):
        samples = recording(
            shape, place(shape, bearing, distance), snr_db=snr_db, seed=seed
        )
        assert faults(samples, shape) == []


def test_short_sounds_between_long_echoes_are_shared():
    """Between six of 5 ms channels have nothing in common, and one is fainter."""
    rng = np.random.default_rng(1)
    count, length = round(SECONDS * FS), round(0.005 * FS)
    samples = 0.01 * rng.standard_normal((4, count))
    samples[3] *= 4.0
    for begin in np.arange(0.2, 3.0, 0.5):
        k = round(begin * FS)
        samples[:, k : k + length] += rng.standard_normal(length)
    assert faults(samples, SQUARE) == []
    samples[2] = 0.01 * rng.standard_normal(count)
    assert ("dead", (2,)) in faults(samples, SQUARE)


def test_channels_that_share_no_sound_are_not_inverted():
    """Two hear one sound, and two another: no pair is upside down."""
    for seed in range(6):
        rng = np.random.default_rng(seed)
        one, other = rng.standard_normal((2, round(SECONDS * FS)))
        samples = np.array([one, one, other, other])[rng.permutation(4)]
        samples += 0.3 * rng.standard_normal(samples.shape)
        assert not [kind for kind, _ in faults(samples, SQUARE) if kind == "inverted"]


def test_silence_noise_and_tones_are_no_faults():
    generator = np.random.default_rng(1)
    noise = 1e-3 * generator.standard_normal((5, 2 * FS))
    assert faults(noise) == []
    assert faults(np.rint(noise * 2**10) / 2**15) == []
    tone = np.sin(2 * np.pi * 997.0 * np.arange(FS) / FS + np.arange(5)[:, None])
    assert faults(np.rint(tone * 1000.0) / 2**15 + 1e-5 * noise[:, :FS]) == []


@pytest.mark.parametrize("k", range(5))
def test_channels_that_say_nothing(k):
    samples = recording(FIVE, place(FIVE, 130.0, 1.5))
    generator = np.random.default_rng(2)
    for instead in (
        0.25 * np.ones(samples.shape[1]),
        samples[k] * 1e-3,
        samples.std() * generator.standard_normal(samples.shape[1]),
    ):
        broken = samples.copy()
        broken[k] = instead
        assert faults(broken) == [("dead", (k,))]
    broken = samples.copy()
    broken[k, 777] = np.nan
    assert faults(broken) == [("nan", (k,))]


@pytest.mark.parametrize("share", [0.3, 0.7])
def test_clipping(share):
    samples = recording(FIVE, place(FIVE, 130.0, 1.5))
    limit = share * np.abs(samples[3]).max()
    samples[3] = np.clip(samples[3], -limit, limit)
    assert faults(samples) == [("clipped", (3,))]
    stuck = recording(FIVE, place(FIVE, 130.0, 1.5))
    stuck[1] = np.minimum(stuck[1], 0.5 * stuck[1].max())
    assert faults(stuck) == [("clipped", (1,))]


@pytest.mark.parametrize("shape", [ROW, SQUARE, FIVE])
def test_inverted_channels(shape):
    samples = recording(shape, place(shape, 20.0, 1.5))
    for k in range(shape.count):
        broken = samples.copy()
        broken[k] *= -1.0
        assert faults(broken, shape) == [("inverted", (k,))]


def test_an_inverted_channel_does_not_hide_another_fault():
    samples = recording(FIVE, place(FIVE, 20.0, 1.5))[[0, 3, 2, 1, 4]]
    samples[2] *= -1.0
    samples[0, 5] = np.inf
    assert faults(samples) == [("nan", (0,)), ("inverted", (2,))]
    samples[0, 5] = 0.0
    assert faults(samples) == [("inverted", (2,)), ("swapped", (1, 3))]


@pytest.mark.parametrize("bearing", [-140.0, 10.0, 70.0])
def test_every_exchange_in_an_uneven_array(bearing):
    """Unless the two hear it at one time, or their delays fit another place."""
    p_AS = place(FIVE, bearing, 1.5)
    samples = recording(FIVE, p_AS)
    ranges = np.linalg.norm(FIVE.p_AM - p_AS, axis=1)
    seen = []
    for i, j in FIVE.pairs.tolist():
        broken = samples.copy()
        broken[[i, j]] = broken[[j, i]]
        found = faults(broken)
        assert found in ([], [("swapped", (i, j))])
        if abs(ranges[i] - ranges[j]) > 0.1:
            seen.append(bool(found))
    assert len(seen) >= 6
    assert np.mean(seen) > 0.5


def test_exchanged_neighbors_of_a_row():
    """They fake a source amid the row, which would be heard at other levels."""
    samples = recording(ROW, place(ROW, 35.0, 2.0))
    assert faults(samples[[1, 0, 2]], ROW) == [("swapped", (0, 1))]
    # The ends: a mirror image, which nothing tells.
    assert faults(samples[[2, 1, 0]], ROW) == []


def test_a_square_names_both_sides():
    samples = recording(SQUARE, place(SQUARE, 35.0, 2.0))
    found = found_faults(samples[[1, 0, 2, 3]], SQUARE)
    assert [(f.kind, f.channels) for f in found] == [("swapped", (0, 1, 2, 3))]
    assert "channels 1 and 2 or 3 and 4" in found[0].message
    assert faults(samples[[2, 1, 0, 3]], SQUARE) == []


def test_a_geometry_that_is_too_small_fits_nothing():
    samples = recording(FIVE, place(FIVE, 50.0, 1.5))
    small = ArrayShape.of(0.75 * FIVE.p_AM)
    assert faults(samples, small) == [("geometry", ())]


@pytest.mark.parametrize("order", [[0, 1, 2, 3, 4], [3, 1, 2, 0, 4]])
def test_a_source_at_a_microphone(order):
    """It hides the order: levels tell of the place, and one is far from all others."""
    samples = recording(FIVE, FIVE.p_AM[2] + np.array([0.02, 0.0, 0.0]))
    assert faults(samples[order]) == [("near", (2,))]


@pytest.mark.parametrize(
    ("places", "p_AS", "where"),
    [
        (ROW.p_AM, (8.0, 0.0), "straight ahead of it"),
        (np.pad(SQUARE.p_AM, ((0, 0), (0, 1))), (0.0, 0.0, 2.0), "above or below it"),
    ],
)
def test_a_source_straight_ahead_or_above_says_little_of_the_size(places, p_AS, where):
    shape = ArrayShape.of(places)
    (fault,) = found_faults(recording(shape, np.array(p_AS)), shape)
    assert fault.kind == "size"
    assert where in fault.message


def test_a_source_at_one_of_three_microphones_leaves_the_others_alive():
    """1 mm from the first one, 50 to 60 dB louder there than at the others."""
    samples = recording(ROW, ROW.p_AM[0] + np.array([0.001, 0.0]), snr_db=80.0)
    assert faults(samples, ROW) == [("near", (0,))]


@pytest.mark.parametrize(
    ("scale", "kind"), [(1 / 3, "units"), (0.5, "units"), (0.7, "geometry")]
)
def test_delays_longer_than_the_array(scale, kind):
    """Positions given too small: sound would take up to three times as long."""
    for shape in (ROW, FIVE):
        samples = recording(shape, place(shape, 50.0, 1.5))
        found = faults(samples, ArrayShape.of(scale * shape.p_AM))
        assert found == [(kind, ())]


@pytest.mark.parametrize(
    ("edge_m", "scale"),
    [(1.0, 0.01), (0.17, 1 / 0.0254), (0.07, 1 / 0.0254), (1.0, 0.1), (0.1, 0.1)],
)
def test_a_tetrahedron_in_other_units(edge_m, scale):
    """Its delays reach its edges in every direction, so no source is out of sight."""
    corners = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]
    shape = ArrayShape.of(edge_m / math.sqrt(8.0) * np.array(corners))
    samples = recording(shape, place(shape, 20.0, 4.0))
    assert faults(samples, ArrayShape.of(scale * shape.p_AM)) == [("units", ())]


def test_short_recordings_are_looked_at_within_a_short_reach():
    """Of 0.4 s, cut as 3 m need it (12 crossings), three frames are left: too few.

    An array of 0.7 m across that is said to be a tenth of that.
    """
    samples = recording(FIVE, place(FIVE, 50.0, 1.5))[:, : round(0.4 * FS)]
    assert len(samples[0]) // (12 * 3.0 / C * FS) == 3
    assert faults(samples, ArrayShape.of(0.1 * FIVE.p_AM)) == [("units", ())]


def test_rumble_of_one_channel_is_not_its_level():
    """40 dB above the sound, but at 40 Hz: below the band."""
    samples = recording(FIVE, place(FIVE, 50.0, 1.5))
    t = np.arange(samples.shape[1]) / FS
    samples[2] += 140.0 * samples.std() * np.sin(2 * np.pi * 40.0 * t)
    assert faults(samples) == []


def test_the_loudest_frames_of_a_long_recording_are_looked_at():
    """3 s of sound at the end of 20 s; 64 frames are 3.2 s."""
    heard = recording(FIVE, place(FIVE, 50.0, 1.5))
    heard[1] *= -1.0
    generator = np.random.default_rng(3)
    samples = 1e-3 * generator.standard_normal((5, 20 * FS))
    samples[:, -heard.shape[1] :] += heard
    assert faults(samples) == [("inverted", (1,))]


def test_a_channel_that_is_another_ones_copy():
    samples = recording(FIVE, place(FIVE, 20.0, 1.5))
    samples[3] = samples[1]
    assert ("copied", (1, 3)) in faults(samples)


def test_rooms_are_no_fault():
    """Image sources up to a reverberation time of 0.5 s, and a fault in them."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import pyroomacoustics as pra
    dry = recording(ROW, place(ROW, 0.0, 1.0), snr_db=99.0)[1]
    for seconds in (0.2, 0.5):
        absorption, order = pra.inverse_sabine(seconds, [6.0, 5.0, 3.0])
        room = pra.ShoeBox(
            [6.0, 5.0, 3.0],
            fs=FS,
            materials=pra.Material(absorption),
            max_order=min(order, 12),
        )
        p_AM = np.column_stack((FIVE.p_AM, np.zeros(5)))[:, :3]
        room.add_microphone_array((p_AM + np.array([2.0, 2.2, 1.3])).T)
        room.add_source([4.0, 3.1, 1.6], signal=dry)
        room.simulate()
        samples = room.mic_array.signals
        assert faults(samples) == []
        samples[3] *= -1.0
        assert faults(samples) == [("inverted", (3,))]


def test_unequal_gains_that_were_stated_are_no_fault():
    samples = recording(FIVE, place(FIVE, 50.0, 1.5))
    samples *= np.array([[1.0], [1.0], [12.0], [1.0], [1.0]])
    assert [f.kind for f in found_faults(samples, FIVE)] == ["near"]
    assert found_faults(samples, FIVE, gain_std_db=8.0) == []


def test_misplaced_microphones_that_were_stated_are_no_fault():
    """As far off as an exchange of neighbors would put them."""
    samples = recording(SQUARE, place(SQUARE, 35.0, 2.0))[[1, 0, 2, 3]]
    assert [f.kind for f in found_faults(samples, SQUARE)] == ["swapped"]
    assert found_faults(samples, SQUARE, position_std=0.15) == []
