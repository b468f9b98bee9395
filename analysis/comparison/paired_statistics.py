"""Tests whether two methods differ, from runs of both methods on the same layouts."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike


@dataclass(frozen=True)
class PairedRate:
    """How often one method had an outcome that the other method did not have."""

    pairs: int
    only_first: int
    """Pairs in which the first method had the outcome and the second had not."""
    only_second: int
    difference: float
    """Rate of the first method minus rate of the second method."""
    low: float
    """Lower end of the confidence interval of the difference."""
    high: float
    p_value: float
    """Two-sided p-value of the exact McNemar test that both rates are equal."""


@dataclass(frozen=True)
class PairedMedian:
    """Difference of a metric between two methods, with an interval and a test."""

    pairs: int
    """Number of layouts on which both methods have a value."""
    first: float | None
    """Median of the first method over the pairs."""
    second: float | None
    """Median of the second method over the pairs."""
    difference: float | None
    """Median over the pairs of the first value minus the second value."""
    low: float | None
    """Lower end of the interval of ``difference``, from order statistics."""
    high: float | None
    p_value: float | None
    """Two-sided p-value of the Wilcoxon signed-rank test that the differences are
    symmetric about zero."""


def paired_rate(
    first: ArrayLike, second: ArrayLike, confidence: float = 0.95
) -> PairedRate:
    """Compares how often two methods have an outcome, for example a collision.

    Both methods run on the same n layouts. The confidence interval is the adjusted Wald
    interval of Bonett and Price (2012). This interval keeps its coverage even for rare
    outcomes and small samples.

    Args:
        first: (n,) whether the first method had the outcome on each layout, n >= 1.
        second: (n,) whether the second method had the outcome on each layout.
        confidence: Confidence level of the interval, between 0 and 1.

    Returns:
        Difference of the two rates, from -1 to 1, with its confidence interval. The
        result also contains the p-value of the exact McNemar test.
    """
    from scipy.stats import binomtest, norm

    a, b = np.asarray(first, dtype=bool), np.asarray(second, dtype=bool)
    only_first, only_second = int(np.sum(a & ~b)), int(np.sum(~a & b))
    apart, pairs = only_first + only_second, len(a)
    p_value = binomtest(only_first, apart).pvalue if apart else 1.0
    up, down = (only_first + 1) / (pairs + 2), (only_second + 1) / (pairs + 2)
    centre = up - down
    spread = math.sqrt((up + down - centre**2) / (pairs + 2))
    half = float(norm.ppf(0.5 + confidence / 2.0)) * spread
    return PairedRate(
        pairs=pairs,
        only_first=only_first,
        only_second=only_second,
        difference=(only_first - only_second) / pairs,
        low=max(centre - half, -1.0),
        high=min(centre + half, 1.0),
        p_value=float(p_value),
    )


def paired_median(
    first: ArrayLike, second: ArrayLike, *, confidence: float = 0.95
) -> PairedMedian:
    """Compares the values of a metric between two methods.

    Both methods run on the same n layouts.

    Args:
        first: (n,) values of the first method. NaN if a run has no value.
        second: (n,) values of the second method. NaN if a run has no value.
        confidence: Confidence level of the interval, between 0 and 1.

    Returns:
        Medians, and the interval of the median difference, in the unit of the metric.
        The result also contains the p-value of the Wilcoxon signed-rank test. If no
        layout has values of both methods, these numbers are None.
    """
    from scipy.stats import wilcoxon

    from analysis.reporting.intervals import median_interval

    a, b = np.asarray(first, dtype=float), np.asarray(second, dtype=float)
    both = np.isfinite(a) & np.isfinite(b)
    differences = a[both] - b[both]
    if len(differences) == 0:
        return PairedMedian(0, None, None, None, None, None, None)
    low, high = median_interval(differences, confidence=confidence)
    apart = np.any(differences != 0.0)
    return PairedMedian(
        pairs=len(differences),
        first=float(np.median(a[both])),
        second=float(np.median(b[both])),
        difference=float(np.median(differences)),
        low=low,
        high=high,
        p_value=float(wilcoxon(differences).pvalue) if apart else 1.0,
    )
