"""Confidence intervals of rates and of statistics of samples."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray


class Interval(NamedTuple):
    """Where a figure lies, in all likelihood."""

    low: float
    high: float


class Estimate(NamedTuple):
    """A figure with its 95 % interval; NaN where nothing has one."""

    value: float
    low: float
    high: float


def with_interval(
    value: float,
    low: float,
    high: float,
    form: str,
    *,
    unit: str = "",
    factor: float = 1.0,
) -> str:
    """A figure and its interval for readers.

    Args:
        value: The figure.
        low: Lower end of its interval.
        high: Upper end.
        form: Sign and decimals, as ``format`` takes them. A zero gets no minus.
        unit: Stands behind the figure, with a space in front.
        factor: What all are multiplied by.

    Returns:
        Text as '12.5 % (3.1, 22.0)'.
    """
    value, low, high = (factor * each for each in (value, low, high))
    form = form.replace(".", "z.")
    return f"{value:{form}}{unit} ({low:{form}}, {high:{form}})"


def wilson_interval(successes: int, runs: int, *, confidence: float = 0.95) -> Interval:
    """Wilson's score interval of a probability (Wilson 1927), without correction.

    Args:
        successes: Runs in which it happened.
        runs: All runs, at least one.
        confidence: Share of such intervals that hold the true value.

    Returns:
        Both ends, 0 to 1.
    """
    from scipy.stats import binomtest

    result = binomtest(successes, runs).proportion_ci(confidence, method="wilson")
    return Interval(float(result.low), float(result.high))


def bootstrap_interval(
    values: ArrayLike,
    statistic: Callable[..., NDArray[np.float64]] = np.median,
    *,
    seed: int,
    confidence: float = 0.95,
    resamples: int = 2000,
) -> Interval:
    """Percentile bootstrap of a statistic (Efron 1979).

    Args:
        values: (n,) independent samples, at least one.
        statistic: Takes an ``axis``, as ``np.median``.
        seed: Seed of the resampling.
        confidence: As of ``wilson_interval``.
        resamples: Number of resampled sets.

    Returns:
        Both ends, in the unit of the statistic.
    """
    from scipy.stats import bootstrap

    # scipy refuses a single sample: twice the same has the same interval.
    samples = np.resize(np.asarray(values, dtype=float), max(np.size(values), 2))
    found = bootstrap(
        (samples,),
        statistic,
        n_resamples=resamples,
        confidence_level=confidence,
        method="percentile",
        rng=seed,
    )
    return Interval(*map(float, found.confidence_interval))


def median_interval(values: ArrayLike, *, confidence: float = 0.95) -> Interval:
    """Interval of a median from order statistics: for any distribution.

    The number of samples below the true median is binomial, which gives the
    ranks. With fewer than six samples (at 95 %) no two of them are enough:
    the interval is then their range.

    Args:
        values: (n,) independent samples, at least one.
        confidence: As of ``wilson_interval``, at least.

    Returns:
        Two of the samples.
    """
    # The same as quantile_test's, which takes 15 times as long.
    from scipy.stats import binom

    ordered = np.sort(np.asarray(values, dtype=float))
    below = int(binom.ppf(0.5 * (1.0 - confidence), len(ordered), 0.5))
    rank = max(below - 1, 0)
    return Interval(float(ordered[rank]), float(ordered[-1 - rank]))
