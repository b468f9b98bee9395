"""Whether two methods differ, from runs of both on the same layouts."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike


@dataclass(frozen=True)
class PairedRate:
    """How often one method did what the other did not."""

    pairs: int
    only_first: int
    """Pairs in which the first method did it and the second did not."""
    only_second: int
    difference: float
    """Rate of the first less that of the second."""
    low: float
    """Ends of the interval of the difference."""
    high: float
    p_value: float
    """Exact McNemar test, two-sided: that both rates are equal."""


@dataclass(frozen=True)
class PairedMedian:
    """By how much a figure of one method exceeds that of the other."""

    pairs: int
    """Layouts on which both have the figure."""
    first: float | None
    """Median of the first method over the pairs."""
    second: float | None
    """Median of the second."""
    difference: float | None
    """Median over the pairs of the first's figure less the second's."""
    low: float | None
    """Ends of the interval of that median, from order statistics."""
    high: float | None
    p_value: float | None
    """Wilcoxon signed-rank test, two-sided: differences lie evenly about zero."""


def paired_rate(
    first: ArrayLike, second: ArrayLike, confidence: float = 0.95
) -> PairedRate:
    """Compares how often two methods did something, run by run.

    The interval is the adjusted Wald interval of Bonett and Price (2012), which
    keeps its coverage for rare events and small samples.

    Args:
        first: (n,) whether the first method did it, n >= 1.
        second: (n,) the same of the second, on the same layouts.
        confidence: Of the interval.

    Returns:
        Difference of the rates, -1 to 1, with its interval and McNemar's exact test.
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
    """Compares a figure of two methods, run by run.

    Args:
        first: (n,) figure of the first method; NaN where it has none.
        second: (n,) the same of the second, on the same layouts.
        confidence: Of the interval.

    Returns:
        In the figure's unit; None where no layout has both figures.
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
