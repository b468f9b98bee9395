"""Random numbers of a tick: reproducible, and independent of other ticks'."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from systems.framework.noise import (
    BEFORE_THE_RUN,
    _scrambled,
    _tick_word,
    frame_noise,
    standard_normals,
    tick_generator,
)


def test_scrambler_is_splitmix64():
    """First output of the published generator when seeded with 0, and with its step."""
    assert _scrambled(np.uint64(0)) == 0xE220A8397B1DCDAF
    assert _scrambled(np.uint64(0x9E3779B97F4A7C15)) == 0x6E789E6AA1B965F4


@pytest.mark.parametrize("tick", [0, 1, BEFORE_THE_RUN])
def test_seed_and_tick_decide(tick):
    first = tick_generator(7, tick).standard_normal(8)
    np.testing.assert_array_equal(first, tick_generator(7, tick).standard_normal(8))
    assert not np.isin(first, tick_generator(8, tick).standard_normal(8)).any()


def test_neighboring_seeds_and_ticks_are_independent():
    """400 streams of 400 numbers: correlations scatter as chance has it."""
    rows = np.array(
        [
            tick_generator(seed, tick).standard_normal(400)
            for seed in range(20)
            for tick in range(20)
        ]
    )
    correlation = np.corrcoef(rows)[np.triu_indices(400, 1)]
    # Of 79 800 coefficients of deviation 1/20, none beyond 5.3 deviations.
    assert np.std(correlation) == pytest.approx(0.05, rel=0.02)
    assert np.abs(correlation).max() < 5.3 * 0.05
    assert np.mean(rows[:, 0]) == pytest.approx(0.0, abs=0.2)
    assert np.std(rows[:, 0]) == pytest.approx(1.0, abs=0.15)


@pytest.mark.parametrize("draw", [standard_normals, frame_noise])
def test_normal_numbers_are_normal(draw):
    """Kolmogorov and Smirnov, four moments, tails, no correlation from one to next."""
    values = draw((4, 500_000), 3, 5).astype(float).ravel()
    assert stats.kstest(values, "norm").pvalue > 0.01
    # Standard errors of mean, variance, skewness and kurtosis of 2e6 numbers.
    n = values.size
    assert abs(values.mean()) < 4.0 / np.sqrt(n)
    assert abs(values.var() - 1.0) < 4.0 * np.sqrt(2.0 / n)
    assert abs(stats.skew(values)) < 4.0 * np.sqrt(6.0 / n)
    assert abs(stats.kurtosis(values)) < 4.0 * np.sqrt(24.0 / n)
    beyond = np.sum(np.abs(values) > 4.0)
    expected = 2.0 * n * stats.norm.sf(4.0)
    assert abs(beyond - expected) < 4.0 * np.sqrt(expected)
    assert abs(np.corrcoef(values[:-1], values[1:])[0, 1]) < 4.0 / np.sqrt(n)


@pytest.mark.parametrize("draw", [standard_normals, frame_noise])
def test_normal_numbers_depend_on_seed_and_tick_alone(draw):
    first = draw((3, 7), 1, 2)
    np.testing.assert_array_equal(first, draw((3, 7), 1, 2))
    assert not np.isin(first, draw((3, 7), 1, 3)).any()
    assert not np.isin(first, draw((3, 7), 2, 2)).any()


def test_partners_of_a_pair_have_nothing_in_common():
    """Neither they nor their squares: both come from one radius."""
    pairs = frame_noise((800, 1250), 4, 1).astype(float).reshape(800, 2, 625)
    first, second = pairs[:, 0].ravel(), pairs[:, 1].ravel()
    for a, b in ((first, second), (first**2, second**2), (first**2, second)):
        assert abs(np.corrcoef(a, b)[0, 1]) < 4.0 / np.sqrt(first.size)


def test_frame_noise_is_what_box_and_muller_say():
    """In double precision, from the words of splitmix64; two blocks of pairs."""
    state, step, mask = int(_tick_word(3, 8)), 0x9E3779B97F4A7C15, (1 << 64) - 1
    places = [np.uint64((state + k * step) & mask) for k in range(1250)]
    words = np.array([_scrambled(place) for place in places], dtype=np.uint64)
    u = ((words >> 41) + 0.5) / 2.0**23
    turn = (words >> 16 & 0xFFFFFF).astype(np.int64)
    angle = (np.where(turn < 2**23, turn, turn - 2**24) + 0.5) / 2.0**23 * np.pi / 4.0
    upright = (words & 1).astype(bool)
    cosine, sine = np.cos(angle), np.sin(angle)
    signs = 1.0 - 2.0 * np.array([words >> 1 & 1, words >> 2 & 1])
    parts = np.where(upright, [sine, cosine], [cosine, sine])
    pairs = signs * np.sqrt(-2.0 * np.log(u)) * parts
    expected = np.concatenate([pairs[:, :625].ravel(), pairs[:, 625:].ravel()])
    found = frame_noise((2, 1250), 3, 8).ravel()
    np.testing.assert_allclose(found, expected, rtol=2e-6, atol=2e-6)
