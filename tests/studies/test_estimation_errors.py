"""Ratios and intervals of errors that are drawn from known distributions."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.stats import binomtest, chi2

from studies.support.estimation_errors import consistency, rms_ratio, stated_ratio


@given(k=st.integers(1, 500), scale=st.floats(1e-3, 1e3))
def test_interval_holds_the_ratio_and_scales(k, scale):
    """The interval is that of the chi-square law, so its ends are its quantiles."""
    ratio = rms_ratio(scale * np.ones(k), np.ones(k))
    assert ratio.value == pytest.approx(scale)
    for end, share in ((ratio.low, 0.975), (ratio.high, 0.025)):
        assert chi2.cdf(k * (ratio.value / end) ** 2, k) == pytest.approx(share)


def test_intervals_cover_as_often_as_they_say():
    rng = np.random.default_rng(2)
    inside = 0
    for _ in range(1_000):
        ratio = rms_ratio(3.0 * rng.standard_normal(50), 2.0)
        inside += ratio.low <= 1.5 <= ratio.high
    assert binomtest(inside, 1_000, 0.95).pvalue > 1e-3


def test_nothing_known_without_errors():
    ratio = rms_ratio([], [])
    assert (ratio.value, ratio.low, ratio.high) == (math.inf, 0.0, math.inf)


def test_stated_over_actual():
    assert stated_ratio([3.0, 3.0], [1.0, -1.0]) == pytest.approx(3.0)
    assert stated_ratio([1.0], [0.0]) == math.inf


@pytest.mark.parametrize("dimension", [2, 3])
def test_consistency_knows_right_from_wrong(dimension):
    rng = np.random.default_rng(dimension)
    mix = rng.standard_normal((500, dimension, dimension))
    covariances = mix @ mix.transpose(0, 2, 1) + 0.1 * np.eye(dimension)
    factors = np.linalg.cholesky(covariances)
    errors = np.einsum("kij,kj->ki", factors, rng.standard_normal((500, dimension)))
    right = consistency(errors, covariances)
    assert right.holds
    assert chi2.cdf(500 * right.low, 500 * dimension) == pytest.approx(0.025)
    assert chi2.cdf(500 * right.high, 500 * dimension) == pytest.approx(0.975)
    assert not consistency(1.2 * errors, covariances).holds
    assert consistency(1.2 * errors, covariances).mean == pytest.approx(
        1.44 * right.mean
    )
