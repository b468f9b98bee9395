"""Paired tests against closed forms and exact enumeration."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pytest
from hypothesis import given, strategies as st

from analysis.batches.pairs import paired_median, paired_rate


def flags(both: int, only_first: int, only_second: int, neither: int):
    counts = (both, only_first, only_second, neither)
    return (
        np.repeat([True, True, False, False], counts),
        np.repeat([True, False, True, False], counts),
    )


def test_mcnemar_is_a_coin_thrown_for_each_discordant_pair():
    """5 of 20: twice the lower tail of the binomial with 1/2."""
    rate = paired_rate(*flags(30, 5, 15, 50))
    tail = sum(math.comb(20, k) for k in range(6)) / 2**20
    assert rate.p_value == pytest.approx(2.0 * tail)
    assert (rate.difference.n, rate.only_first, rate.only_second) == (100, 5, 15)
    assert rate.difference.value == pytest.approx(-0.10)


def test_methods_that_never_differ():
    rate = paired_rate(*flags(3, 0, 0, 7))
    assert rate.p_value == 1.0
    assert rate.difference.low < rate.difference.value == 0.0 < rate.difference.high


@pytest.mark.parametrize(("level", "z"), [(0.95, 1.959964), (0.90, 1.644854)])
def test_interval_is_walds_with_a_pair_more_of_each_kind(level, z):
    """20 and 10 of 100: 0.1 and a standard error of sqrt(0.3 - 0.01) / 10."""
    first, second = flags(0, 19, 9, 70)
    rate = paired_rate(first, second, level=level)
    half = z * math.sqrt(0.29) / 10.0
    assert rate.difference.ends == pytest.approx((0.1 - half, 0.1 + half), abs=1e-6)


def test_interval_ends_where_differences_do():
    """Of one pair it would go from -0.73 to 1.40."""
    rate = paired_rate([True], [False])
    half = 1.959964 * math.sqrt((1.0 - 1.0 / 9.0) / 3.0)
    assert (rate.difference.value, rate.difference.high) == (1.0, 1.0)
    assert rate.difference.low == pytest.approx(1.0 / 3.0 - half, abs=1e-6)
    assert paired_rate([False], [True]).difference.low == -1.0


@given(counts=st.tuples(*[st.integers(0, 30)] * 4).filter(lambda c: sum(c) > 0))
def test_swapping_the_methods_swaps_the_sign(counts):
    first, second = flags(*counts)
    there, back = paired_rate(first, second), paired_rate(second, first)
    one, other = there.difference, back.difference
    assert one.value == -other.value
    assert one.low == pytest.approx(-other.high)
    assert there.p_value == back.p_value
    assert -1.0 <= one.low <= one.high <= 1.0


@pytest.mark.parametrize("rates", [(0.1, 0.1), (0.3, 0.05), (0.02, 0.2), (0.4, 0.3)])
def test_interval_of_the_difference_holds_the_truth_95_percent(rates):
    """Every outcome of 30 pairs, by its multinomial probability."""
    pairs, (up, down) = 30, rates
    covered = 0.0
    for a, b in product(range(pairs + 1), repeat=2):
        rest = pairs - a - b
        if rest < 0:
            continue
        ways = math.comb(pairs, a) * math.comb(pairs - a, b)
        chance = ways * up**a * down**b * (1.0 - up - down) ** rest
        rate = paired_rate(*flags(0, a, b, rest)).difference
        covered += chance * (rate.low <= up - down <= rate.high)
    assert 0.93 <= covered <= 0.995


def test_wilcoxon_of_five_differences_of_one_sign():
    """All ranks on one side: 2 of the 2^5 equally likely outcomes."""
    second = np.zeros(5)
    median = paired_median(np.array([0.1, 0.2, 0.3, 0.4, 0.5]), second)
    assert median is not None
    assert median.p_value == pytest.approx(2.0 / 2**5)
    assert median.difference.value == pytest.approx(0.3)
    assert median.difference.ends == pytest.approx((0.1, 0.5))


def test_interval_of_a_median_is_as_wide_as_asked():
    """Of five draws all lie to one side in 2 of 32 cases, four or more in 12 of 32."""
    first = np.array([0.1, 0.2, 0.3, 0.4, 0.5])
    for level, ends in ((0.95, (0.1, 0.5)), (0.6, (0.2, 0.4))):
        median = paired_median(first, np.zeros(5), level=level)
        assert median is not None
        assert median.difference.ends == pytest.approx(ends)


def test_one_difference_among_ties_is_a_coin_thrown_once():
    first = np.array([1.0, 1.0, 1.0, 2.0])
    median = paired_median(first, np.ones(4))
    assert median is not None
    assert (median.difference.n, median.difference.value) == (4, 0.0)
    assert median.p_value == 1.0


def test_pairs_in_which_one_has_no_figure_are_left_out():
    first = np.array([1.0, np.nan, 3.0, 4.0])
    second = np.array([0.5, 1.0, np.nan, 3.5])
    median = paired_median(first, second)
    assert median is not None
    assert (median.difference.n, median.difference.value) == (2, 0.5)
    assert (median.first, median.second) == (2.5, 2.0)


def test_no_pair_at_all():
    assert paired_median(np.array([np.nan]), np.array([1.0])) is None


def test_figures_that_never_differ():
    same = np.arange(4.0)
    median = paired_median(same, same)
    assert median is not None
    assert (median.difference.value, *median.difference.ends) == (0.0, 0.0, 0.0)
    assert median.p_value == 1.0
