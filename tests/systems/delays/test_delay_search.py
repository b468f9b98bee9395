"""The first look at a frame: peaks, and how likely noise has them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, strategies as st
from numpy.random import Generator, Philox
from scipy import signal, stats

from systems.delays.delay_plan import DelayPlan
from systems.delays.delay_search import _chance_of_noise, _peak, weakest_sound
from systems.delays.delays import look
from systems.sound.array_shape import ArrayShape

FS, N = 100_000.0, 2500
ROW = ArrayShape.of([[0.0, 0.4], [0.0, 0.0], [0.0, -0.4]])
SQUARE = ArrayShape.of([[0.15, 0.15], [0.15, -0.15], [-0.15, -0.15], [-0.15, 0.15]])
ANGLES = np.arange(8) * np.pi / 4.0
RING = ArrayShape.of(np.stack((0.2 * np.cos(ANGLES), 0.2 * np.sin(ANGLES)), axis=1))


def plan(shape):
    return DelayPlan(shape, 340.0, FS, N, 300.0, 15_000.0)


def noises(shape, color, frames):
    """Frames of independent noise in the channels."""
    generator = Generator(Philox(key=8))
    for _ in range(frames):
        rows = generator.standard_normal((shape.count, N))
        if color == "brown":
            rows = signal.lfilter([1.0], [1.0, -0.97], rows)
        if color == "band":
            rows = signal.sosfilt(BAND, rows)
        yield rows.astype(np.float32)


BAND = signal.butter(4, [1_000, 4_000], "bandpass", fs=FS, output="sos")


@pytest.mark.parametrize("color", ["white", "brown", "band"])
@pytest.mark.parametrize("shape", [ROW, SQUARE, RING], ids=["3", "4", "8"])
def test_chances_of_noise_are_uniform_or_safer(shape, color):
    """No more of them below p than a share p, by a binomial test at 0.1 %.

    Edges that meet in a microphone share its noise: with eight microphones and
    colored noise a set rate of 10 % is exceeded by a quarter, one of 3 % is met.
    """
    its_plan = plan(shape)
    chances = []
    for rows in noises(shape, color, 600):
        seen = look(rows, its_plan)
        assert seen is not None
        chances.append(seen[0].chance)
    for p in (0.03, 0.01, 1e-3):
        count = int(np.count_nonzero(np.array(chances) <= p))
        test = stats.binomtest(count, len(chances), p, alternative="greater")
        assert test.pvalue > 1e-3, (p, count)


@pytest.mark.parametrize("rate", [1e-2, 1e-4, 1e-7])
@pytest.mark.parametrize("shape", [ROW, SQUARE, RING], ids=["3", "4", "8"])
def test_the_weakest_sound_is_heard_in_half_of_the_frames(shape, rate):
    """Or in more, with more than three microphones; none 3 dB below, all 3 dB above."""
    its_plan = plan(shape)
    energy = weakest_sound(its_plan, rate)
    shares = []
    for factor in (0.5, 1.0, 2.0):
        generator = Generator(Philox(key=8))
        sound = np.sqrt(factor * energy) * generator.standard_normal((100, 1, N))
        frames = sound + generator.standard_normal((100, shape.count, N))
        seen = [look(frame, its_plan) for frame in frames.astype(np.float32)]
        chances = [found[0].chance for found in seen if found is not None]
        shares.append(np.mean(np.array(chances) <= rate))
    assert shares[0] <= 0.1
    assert shares[1] == pytest.approx(0.5, abs=0.15) or shape is not ROW
    assert shares[1] >= 0.35
    assert shares[2] >= 0.99


@given(
    st.lists(
        st.tuples(st.floats(0.0, 6.0), st.floats(0.0, 30.0)), min_size=1, max_size=7
    )
)
def test_chance_is_fishers_of_the_pairs(edges):
    """Each pair's by scipy's normal distribution and Rice's rate, joined by scipy."""
    heights, counts = np.array(edges).T
    below = stats.norm.cdf(heights) * np.exp(-counts * np.exp(-(heights**2) / 2.0))
    joined = stats.combine_pvalues(np.clip(1.0 - below, 1e-300, 1.0)).pvalue
    assert _chance_of_noise(heights, counts)[0] == pytest.approx(joined, rel=1e-6)


@given(st.lists(st.floats(0.0, 50.0), min_size=2, max_size=8), st.data())
def test_higher_peaks_are_less_likely_noise(heights, data):
    counts = np.full(len(heights), 9.0)
    k = data.draw(st.integers(0, len(heights) - 1))
    higher = np.array(heights)
    higher[k] += data.draw(st.floats(0.0, 50.0))
    least, _ = _chance_of_noise(higher, counts)
    more, _ = _chance_of_noise(np.array(heights), counts)
    assert 0.0 <= least <= more * (1.0 + 1e-9) + 1e-300
    assert more <= 1.0


@given(st.integers(30, 170), st.integers(30, 170), st.floats(0.0, 0.95))
def test_second_peak_over_the_first(first, second, height):
    """Two triangles whose feet do not meet."""
    if abs(first - second) < 20:
        return
    k = np.arange(201)
    peaks = np.maximum(1.0 - np.abs(k - first) / 8.0, 0.0)
    peaks += height * np.maximum(1.0 - np.abs(k - second) / 8.0, 0.0)
    best, ratio = _peak(peaks)
    # What is left of the first peak's own lobe is just below half of it.
    assert best == first
    assert ratio == pytest.approx(max(height, 0.5), abs=0.13)


@pytest.mark.parametrize(
    "values",
    [np.arange(9.0), np.arange(9.0)[::-1], -1.0 - np.abs(np.arange(9.0) - 4)],
    ids=["rises to the border", "falls from it", "nowhere positive"],
)
def test_what_is_no_peak_is_ambiguous(values):
    assert _peak(values.copy())[1] == 1.0


@pytest.mark.parametrize("shape", [ROW, SQUARE, RING], ids=["3", "4", "8"])
def test_arrivals_of_whole_samples(shape):
    """Neighboring channels are joined to a tree that reaches all."""
    source = Generator(Philox(key=3)).standard_normal(N + 400)
    source = signal.sosfilt(BAND, source)
    ranges = np.linalg.norm(np.array([1.5, 0.9]) - shape.p_AM, axis=1)
    later = np.rint((ranges - ranges[0]) / 340.0 * FS).astype(int)
    rows = np.array([source[200 - k : 200 - k + N] for k in later])
    seen = look(rows.astype(np.float32), plan(shape))
    assert seen is not None
    np.testing.assert_allclose(seen[0].arrivals, later, atol=0.5)
    assert seen[0].chance < 1e-12
    assert seen[0].ambiguity < 0.9
