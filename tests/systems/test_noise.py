"""Random numbers of a tick: reproducible, and independent of other ticks'."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from systems.noise import BEFORE_THE_RUN, _scrambled, standard_normals, tick_generator


def test_scrambler_is_splitmix64():
    """First output of the published generator when seeded with 0, and with its step."""
    assert _scrambled(np.uint64(0)) == 0xE220A8397B1DCDAF
    assert _scrambled(np.uint64(0x9E3779B97F4A7C15)) == 0x6E789E6AA1B965F4


@pytest.mark.parametrize("tick", [0, 1, BEFORE_THE_RUN])
def test_seed_and_tick_decide(tick):
    first = tick_generator(7, tick).standard_normal(8)
    np.testing.assert_array_equal(first, tick_generator(7, tick).standard_normal(8))
    assert not np.isin(first, tick_generator(8, tick).standard_normal(8)).any()


def test_neighbouring_seeds_and_ticks_are_independent():
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


def test_standard_normals_are_normal():
    """Kolmogorov and Smirnov, four moments, tails, no correlation from one to next."""
    values = standard_normals((4, 500_000), 3, 5).astype(float).ravel()
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


def test_standard_normals_depend_on_seed_and_tick_alone():
    first = standard_normals((3, 7), 1, 2)
    np.testing.assert_array_equal(first, standard_normals((3, 7), 1, 2))
    assert not np.isin(first, standard_normals((3, 7), 1, 3)).any()
    assert not np.isin(first, standard_normals((3, 7), 2, 2)).any()
