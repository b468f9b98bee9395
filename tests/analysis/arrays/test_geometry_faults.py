"""Another speed of sound, near sources and directional microphones, by closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.arrays.array_budget import ArrayBudget
from analysis.arrays.array_geometry import KnownArray
from analysis.arrays.channel_faults import find_channel_faults
from analysis.arrays.frame_delays import FrameDelays, near_range_m, slower_than_stated
from analysis.arrays.geometry_faults import geometry_faults
from systems.sound.array_shape import ArrayShape
from tests.analysis.arrays.test_channel_faults import (
    FIVE,
    FS,
    SQUARE,
    C,
    found_faults,
    place,
    recording,
)

METERS_PER_SAMPLE = C / FS
SPACE = ArrayShape.of(
    0.2 * np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1.0]])
)
SMALL = ArrayShape.of(0.0325 * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1.0]]))


def frames(shape, p_AS, *, faster=1.0, gains_db=None, count=20, seed=0) -> FrameDelays:
    """Delays and levels of a point source, with errors of 0.05 samples and 0.3 dB."""
    rng = np.random.default_rng(seed)
    ranges = np.linalg.norm(shape.p_AM - p_AS, axis=1)
    arrival = ranges / faster / METERS_PER_SAMPLE
    each = arrival + 0.05 * rng.standard_normal((count, shape.count))
    i, j = shape.pairs.T
    level_db = -20.0 * np.log10(ranges) if gains_db is None else np.array(gains_db)
    level_db = level_db + 0.3 * rng.standard_normal((count, shape.count))
    levels = 10.0 ** (level_db / 20.0)
    return FrameDelays(each[:, j] - each[:, i], levels, shape, METERS_PER_SAMPLE)


@pytest.mark.parametrize("direction", [(1, 0.3, 0.2), (-0.4, 0.9, -0.2), (0, 0, 1)])
@pytest.mark.parametrize("faster", [2.5, 4.35])
def test_the_speed_of_sound_of_water(direction, faster):
    far = 20.0 * np.array(direction) / np.linalg.norm(direction)
    delays = frames(SPACE, far, faster=faster)
    ratio = slower_than_stated(delays)
    assert ratio == pytest.approx(1.0 / faster, rel=0.1)
    (fault,) = geometry_faults(delays, C, list)
    assert fault.kind == "speed"
    speed = float(fault.message.partition("about ")[2].partition(" m/s")[0])
    assert speed == pytest.approx(faster * C, rel=0.1)


@pytest.mark.parametrize("distance", [0.1, 0.5, 20.0])
def test_sources_in_air_have_the_stated_speed(distance):
    """Also one amid the array, whose short delays come with unequal levels."""
    p_AS = distance * np.array([1.0, 0.3, 0.2]) / np.linalg.norm([1.0, 0.3, 0.2])
    assert slower_than_stated(frames(SPACE, p_AS)) is None


def test_a_plane_does_not_measure_the_speed():
    assert slower_than_stated(frames(SQUARE, np.array([20.0, 5.0]), faster=4.3)) is None


@pytest.mark.parametrize("distance", [0.08, 0.12, 0.16])
def test_a_near_source_is_named_with_its_distance(distance):
    p_AS = distance * np.array([np.cos(0.6), np.sin(0.6)])
    delays = frames(SMALL, p_AS)
    assert near_range_m(delays) == pytest.approx(distance, rel=0.2)
    (fault,) = geometry_faults(delays, C, list)
    assert (fault.kind, fault.channels) == ("near", ())
    assert "0.2 m away" in fault.message


def test_equal_levels_are_those_of_no_near_source():
    """Delays of a late channel may fit a near place."""
    p_AS = 0.1 * np.array([np.cos(0.6), np.sin(0.6)])
    assert near_range_m(frames(SMALL, p_AS, gains_db=[0.0] * 4)) is None
    assert near_range_m(frames(SMALL, 20.0 * p_AS)) is None


@pytest.mark.parametrize(("gain", "kind"), [(-1.0, "inverted"), (-0.4, "directional")])
def test_rear_lobes_are_fainter_than_inverted_channels(gain, kind):
    samples = recording(FIVE, place(FIVE, 50.0, 3.0))
    samples[3] *= gain
    (fault,) = found_faults(samples, FIVE)
    assert (fault.kind, fault.channels) == (kind, (3,))
    assert ("directional microphones?" in fault.message) == (kind == "directional")


def test_a_faint_channel_may_be_late_by_an_echo():
    """20 ms late is a recorder, or a microphone that hears only an echo if fainter."""
    samples = recording(SQUARE, place(SQUARE, 35.0, 3.0))
    samples[2] = np.roll(samples[2], round(0.02 * FS))
    (fault,) = found_faults(samples, SQUARE)
    assert (fault.kind, fault.channels) == ("unaligned", (2,))
    samples[2] *= 0.5
    (fault,) = found_faults(samples, SQUARE)
    assert fault.kind == "directional"
    assert "late against" in fault.message


def far_apart(seed, *, dead=False):
    """Claps of which two near microphones share the echoes, and a far one little."""
    rng = np.random.default_rng(seed)
    count = round(0.6 * FS)
    envelope = np.exp(-np.arange(count) / (0.08 * FS))
    echoes = rng.standard_normal((2, count)) * envelope
    rows = np.array([echoes[0], echoes[0], echoes[1]])
    noise = 0.01 * rng.standard_normal(rows.shape)
    if dead:
        rows[2], noise[2] = 0.0, rows[0].std() * rng.standard_normal(count)
    return rows + noise


def of_row(samples):
    shape = ArrayShape.of([[0.0, 0.0], [0.02, 0.0], [1.0, 0.0]])
    array = KnownArray(shape, C, ArrayBudget(1e-6 * np.eye(6), 0.0, 0.0))
    return find_channel_faults(samples, array, sample_rate_hz=FS)


@pytest.mark.parametrize("seed", range(5))
def test_a_channel_far_from_others_among_echoes_is_not_dead(seed):
    kinds = [(f.kind, f.channels) for f in of_row(far_apart(seed))]
    assert kinds == [("apart", (2,))]
    kinds = [(f.kind, f.channels) for f in of_row(far_apart(seed, dead=True))]
    assert kinds == [("dead", (2,))]
