"""Delays of a known source against arrays that are said to be of another size."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.arrays.frame_delays import DelayScale, FrameDelays, delay_scale
from systems.sound.array_shape import ArrayShape

METERS_PER_SAMPLE = 340.0 / 16_000.0

# A square of 65 mm across, and four microphones in space within 94 mm.
SQUARE = 0.02285 * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1.0]])
SPACE = 0.03 * np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1.3]])


def lags(places, direction, frames=20, noise=0.05, seed=0):
    """(f, p) delays of plane waves, samples: closed form, with errors."""
    p = np.pad(places, ((0, 0), (0, 3 - places.shape[1])))
    i, j = np.triu_indices(len(p), 1)
    u = np.array(direction) / np.linalg.norm(direction)
    exact = (p[i] - p[j]) @ u / METERS_PER_SAMPLE
    rng = np.random.default_rng(seed)
    each = rng.normal(0.0, noise, (frames, len(p)))
    return exact + each[:, j] - each[:, i]


def scale_of(frames, shape) -> DelayScale | None:
    levels = np.ones((len(frames), shape.count))
    return delay_scale(FrameDelays(frames, levels, shape, METERS_PER_SAMPLE))


@pytest.mark.parametrize("places", [SQUARE, SPACE])
@pytest.mark.parametrize("direction", [(1, 0, 0.3), (-0.4, 0.9, -0.2), (0, 0, 1)])
def test_right_size(places, direction):
    shape = ArrayShape.of(places)
    assert scale_of(lags(places, direction), shape) is None


@pytest.mark.parametrize(("unit", "times"), [("cm", 100.0), ("inch", 1 / 0.0254)])
@pytest.mark.parametrize("places", [SQUARE, SPACE])
def test_positions_in_a_smaller_unit(unit, times, places):
    """A wave along the array takes a hundredth of what it would, or 2.5 %."""
    found = scale_of(
        lags(places, (1, 0.2, 0), noise=0.0), ArrayShape.of(times * places)
    )
    assert found is not None
    assert found.kind == "nothing"
    assert found.share <= 1.0 / times + 1e-9
    # a / 8 R: from 6.5 m across, 1 % is of at least 81 m.
    aperture = times * ArrayShape.of(places).aperture_m
    assert found.least_range_m >= aperture / 8.0 * times * 0.99


@pytest.mark.parametrize("times", [0.1, 0.0254, 0.01])
def test_positions_in_a_larger_unit(times):
    big = 8.0 * SPACE
    u = np.array([1.0, 0.3, 0.2])
    u /= np.linalg.norm(u)
    found = scale_of(lags(big, u, noise=0.0), ArrayShape.of(times * big))
    assert found is not None
    assert found.kind == "beyond"
    i, j = np.triu_indices(4, 1)
    paths = np.abs((big[i] - big[j]) @ u)
    longest = np.linalg.norm(big[i] - big[j], axis=1)
    # A sample is left for errors.
    expected = ((paths - METERS_PER_SAMPLE) / (times * longest)).max()
    assert found.share == pytest.approx(expected, rel=1e-6)


def test_source_above_a_plane_says_how_far_it_would_be():
    """1.3 m across, delays of 2 % at most: beyond 1.3 / (8 x 0.02) = 8 m."""
    big = 20.0 * SQUARE
    u = np.array([0.02, 0.0, 1.0])
    found = scale_of(lags(big, u, noise=0.0), ArrayShape.of(big))
    assert found is not None
    assert found.kind == "nothing"
    aperture = np.linalg.norm(big[0] - big[2])
    sine = 0.02 / np.hypot(0.02, 1.0)
    assert found.least_range_m == pytest.approx(aperture / (8.0 * sine), rel=1e-6)


def test_delays_that_do_not_agree_say_nothing():
    noise = np.random.default_rng(1).uniform(-9.0, 9.0, (30, 6))
    assert scale_of(noise, ArrayShape.of(SQUARE)) is None
    few = lags(SQUARE, (1, 0, 0))[:4]
    large = ArrayShape.of(100.0 * SQUARE)
    assert scale_of(few, large) is None


@pytest.mark.parametrize(("times", "beyond"), [(1 / 1.3, False), (0.5, True)])
def test_delays_are_impossible_from_half_as_long_again(times, beyond):
    """Of a wave along an edge: echoes and errors make 1.3 times, not 2 times."""
    big = 20.0 * SQUARE
    found = scale_of(lags(big, (1, 0, 0), noise=0.0), ArrayShape.of(times * big))
    assert (found is not None) == beyond
    if found:
        edge = big[0, 0] - big[1, 0]
        expected = (edge - METERS_PER_SAMPLE) / (0.5 * edge)
        assert found.share == pytest.approx(expected, rel=1e-6)
        assert found.least_range_m == 0.0


def test_no_delay_at_all_is_of_a_quarter_sample_at_least():
    """A front from R is a^2 / 8 R from flat: here a quarter of a sample's way."""
    big = 20.0 * SQUARE
    found = scale_of(np.zeros((20, 6)), ArrayShape.of(big))
    assert found is not None
    assert (found.kind, found.share) == ("nothing", 0.0)
    aperture = np.linalg.norm(big[0] - big[2])
    assert found.least_range_m == pytest.approx(aperture**2 / 2.0 / METERS_PER_SAMPLE)


@pytest.mark.parametrize(
    ("good", "bad", "says"),
    [(4, 0, False), (5, 0, True), (5, 20, True), (5, 21, False)],
)
def test_frames_that_agree_are_five_and_a_fifth(good, bad, says):
    right = np.zeros((good, 6))
    wrong = np.zeros((bad, 6))
    wrong[:, 5] = 9.0  # microphones 2 and 3 alone, so that the delays do not add up
    frames = np.concatenate((right, wrong))
    found = scale_of(frames, ArrayShape.of(20.0 * SQUARE))
    assert (found is not None) == says


@pytest.mark.parametrize(("above", "nothing"), [(14, False), (16, True)])
def test_three_quarters_of_the_frames_have_next_to_no_delay(above, nothing):
    big = 20.0 * SQUARE
    frames = np.concatenate(
        (
            lags(big, (0, 0, 1), frames=above, noise=0.0),
            lags(big, (1, 0, 0), frames=20 - above, noise=0.0),
        )
    )
    found = scale_of(frames, ArrayShape.of(big))
    assert (found is not None) == nothing


def test_near_microphones_are_too_near_to_tell():
    """Half a sample is half of the way across 2 cm, and 0.8 % of that across 1.3 m."""
    near = np.array([[1.3, 0.0], [0.0, 1.3], [0.0, 0.0], [0.02, 0.0]])
    frames = np.zeros((20, 6))
    frames[:, [2, 4, 5]] = 0.5  # the last microphone, after each of the others
    found = scale_of(frames, ArrayShape.of(near))
    assert found is not None
    assert found.kind == "nothing"
    assert found.share == pytest.approx(0.5 * METERS_PER_SAMPLE / 1.3, rel=0.02)
