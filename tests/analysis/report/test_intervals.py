from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from analysis.report.intervals import (
    Estimate,
    estimate_mean,
    estimate_median,
    estimate_rate,
)


def test_wilson_interval_of_newcombe():
    # Newcombe 1998, Statistics in Medicine 17, table I: 81 of 263, 15 of 148,
    # 0 of 20 and 1 of 29 by method 3.
    assert estimate_rate(81, 263).ends == pytest.approx((0.2553, 0.3662), abs=5e-5)
    assert estimate_rate(15, 148).ends == pytest.approx((0.0624, 0.1605), abs=5e-5)
    assert estimate_rate(0, 20).ends == pytest.approx((0.0000, 0.1611), abs=5e-5)
    assert estimate_rate(1, 29).ends == pytest.approx((0.0061, 0.1718), abs=5e-5)


def test_bootstrap_interval_of_a_mean_is_that_of_the_normal_law():
    values = np.random.default_rng(1).normal(3.0, 2.0, 400)
    low, high = estimate_mean(values, seed=2, resamples=4000).ends
    half = stats.norm.ppf(0.975) * values.std() / np.sqrt(400)
    assert low == pytest.approx(values.mean() - half, abs=0.05 * half)
    assert high == pytest.approx(values.mean() + half, abs=0.05 * half)


def test_wilson_interval_of_another_confidence():
    """None of n: from 0 to z^2 / (n + z^2), z = 1.644854 at 90 %."""
    top = 1.644854**2 / (20.0 + 1.644854**2)
    assert estimate_rate(0, 20, level=0.9).ends == pytest.approx((0.0, top), abs=1e-6)


@pytest.mark.parametrize(
    ("count", "confidence", "ranks"), [(10, 0.8, (3, 8)), (10, 0.99, (1, 10))]
)
def test_median_interval_of_another_confidence(count, confidence, ranks):
    """P(Binomial(10, 1/2) <= 0, 1, 2) = 0.001, 0.011, 0.055; to 0.1 and 0.005."""
    values = np.arange(1.0, count + 1.0)
    assert estimate_median(values, level=confidence).ends == ranks


def test_bootstrap_interval_of_one_value_is_that_value():
    assert estimate_mean([4.5], seed=1) == Estimate(4.5, 4.5, 4.5, 1)


@pytest.mark.parametrize(
    ("count", "ranks"), [(5, (1, 5)), (6, (1, 6)), (10, (2, 9)), (25, (8, 18))]
)
def test_median_interval_has_the_ranks_of_the_sign_test(count, ranks):
    # Conover, Practical Nonparametric Statistics, 3.2: ranks for 95 %.
    values = np.random.default_rng(1).permutation(np.arange(1.0, count + 1.0))
    assert estimate_median(values).ends == ranks


def test_median_interval_covers():
    generator = np.random.default_rng(3)
    samples = generator.exponential(size=(2000, 40))
    intervals = np.array([estimate_median(values).ends for values in samples])
    covered = (intervals[:, 0] <= np.log(2.0)) & (np.log(2.0) <= intervals[:, 1])
    # Exactly 1 - 2 P(Binomial(40, 1/2) <= 13) = 0.9615.
    assert covered.mean() == pytest.approx(0.9615, abs=0.015)


def test_zero_has_no_minus():
    estimate = Estimate(-1e-9, -0.02, 1e-9, 5)
    assert estimate.text("+.3f", unit=" m") == "+0.000 m (-0.020, +0.000)"


def test_nothing_is_a_dash():
    for estimate in (
        estimate_rate(0, 0),
        estimate_median([]),
        estimate_mean([], seed=1),
    ):
        assert estimate.n == 0
        assert estimate.text(".3f") == "-"
