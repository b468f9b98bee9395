"""Compares estimation errors with their bounds and with their stated uncertainties."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.report.intervals import Estimate

#: Confidence level of all intervals.
CONFIDENCE = 0.95


@dataclass(frozen=True)
class Consistency:
    """Mean normalized estimation error squared (NEES), with its 95 % interval."""

    mean: float
    """Mean of e^T C^-1 e over the errors e with stated covariances C."""
    low: float
    """Lower end of the 95 % interval of the mean for correct covariances."""
    high: float
    """Upper end of the 95 % interval of the mean for correct covariances."""

    @property
    def holds(self) -> bool:
        """Whether the mean lies within the interval."""
        return self.low <= self.mean <= self.high


def rms_ratio(errors: ArrayLike, stds: ArrayLike) -> Estimate:
    """Computes the RMS of errors over the RMS of standard deviations.

    The interval assumes Gaussian errors. Without any error, the ratio is infinite and
    its interval unbounded.

    Args:
        errors: (k,) errors in any unit.
        stds: (k,) standard deviations in the same unit, or one for all errors.

    Returns:
        The ratio, with a 95 % interval.
    """
    from scipy.stats import chi2

    errors = np.asarray(errors, dtype=float)
    if errors.size == 0:
        return Estimate(math.inf, 0.0, math.inf, 0)
    square = float(np.mean(errors**2) / np.mean(np.square(stds)))
    low, high = chi2.interval(CONFIDENCE, errors.size) / np.array(errors.size)
    return Estimate(
        math.sqrt(square),
        math.sqrt(square / high),
        math.sqrt(square / low),
        errors.size,
    )


def stated_ratio(stds: ArrayLike, errors: ArrayLike) -> float:
    """Computes the RMS of stated standard deviations over the RMS of the errors.

    A ratio of 1 means that the stated standard deviations are correct.

    Args:
        stds: (k,) standard deviations in any unit.
        errors: (k,) errors in the same unit.

    Returns:
        The ratio; infinite if all errors are 0.
    """
    rmse = float(np.sqrt(np.mean(np.square(errors))))
    return float(np.sqrt(np.mean(np.square(stds)))) / rmse if rmse else math.inf


def consistency(
    errors: NDArray[np.float64], covariances: NDArray[np.float64]
) -> Consistency:
    """Computes the mean normalized squared error for stated covariances.

    Args:
        errors: (k, d) errors in any unit.
        covariances: (k, d, d) stated covariances, in that unit squared.

    Returns:
        The mean with its 95 % interval. If the covariances are correct, the expected
        value is d.
    """
    from scipy.stats import chi2

    count, dimension = errors.shape
    solved = np.linalg.solve(covariances, errors[:, :, None])[:, :, 0]
    low, high = chi2.interval(CONFIDENCE, dimension * count) / np.array(count)
    mean = np.einsum("ki,ki->k", errors, solved).mean()
    return Consistency(float(mean), float(low), float(high))
