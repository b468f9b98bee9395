"""Confidence intervals of rates and of sample statistics."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray


class Interval(NamedTuple):
    """A confidence interval."""

    low: float
    high: float


class Estimate(NamedTuple):
    """An estimated value with its 95 % confidence interval; NaN without data."""

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
    """Writes a value and its confidence interval for readers.

    Args:
        value: Estimated value.
        low: Lower end of the interval.
        high: Upper end of the interval.
        form: Format of all three numbers, for Python's function ``format``. Zeros never
            have a minus sign.
        unit: Unit after the value, with a leading space.
        factor: Factor that multiplies all three numbers before they are written.

    Returns:
        Text in the form '12.5 % (3.1, 22.0)'.
    """
    value, low, high = (factor * each for each in (value, low, high))
    form = form.replace(".", "z.")
    return f"{value:{form}}{unit} ({low:{form}}, {high:{form}})"


def wilson_interval(successes: int, runs: int, *, confidence: float = 0.95) -> Interval:
    """Computes Wilson's score interval of a probability, without continuity correction.

    Reference: Wilson (1927).

    Args:
        successes: Number of successful runs.
        runs: Number of all runs, at least one.
        confidence: Probability that an interval of this kind contains the true value.

    Returns:
        Both ends of the interval, from 0 to 1.
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
    """Computes the percentile bootstrap interval of a statistic.

    Reference: Efron (1979).

    Args:
        values: (n,) independent samples, n >= 1.
        statistic: Function of samples with an argument ``axis``, for example
            ``np.median``.
        seed: Seed of the resampling.
        confidence: Probability that an interval of this kind contains the true value.
        resamples: Number of resampled sets.

    Returns:
        Both ends of the interval, in the unit of the statistic.
    """
    from scipy.stats import bootstrap

    # scipy rejects a single sample. Two equal samples have the same interval.
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
    """Computes a confidence interval of a median from order statistics.

    The interval is valid for any distribution of the samples. The number of samples
    below the true median has a binomial distribution. This distribution determines
    which two of the sorted samples bound the interval. At 95 % confidence, this needs
    at least six samples. With fewer samples, the interval extends from the least to the
    greatest sample.

    Args:
        values: (n,) independent samples, n >= 1.
        confidence: Least probability that an interval of this kind contains the true
            median.

    Returns:
        Both ends of the interval. Each end is one of the samples.
    """
    # scipy's quantile_test gives the same interval, but takes 15 times as long.
    from scipy.stats import binom

    ordered = np.sort(np.asarray(values, dtype=float))
    below = int(binom.ppf(0.5 * (1.0 - confidence), len(ordered), 0.5))
    rank = max(below - 1, 0)
    return Interval(float(ordered[rank]), float(ordered[-1 - rank]))
