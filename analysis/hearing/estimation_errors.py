"""Whether errors are as small as they can be, and as large as they were stated."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.reporting.intervals import Estimate

#: Of all intervals.
CONFIDENCE = 0.95


@dataclass(frozen=True)
class Consistency:
    """Mean normalised estimation error squared (NEES) beside what it should be."""

    mean: float
    """Mean of e^T C^-1 e."""
    low: float
    """Lower end of what holds the mean with 95 % where C is right."""
    high: float
    """Upper end."""

    @property
    def holds(self) -> bool:
        """Whether the mean lies within."""
        return self.low <= self.mean <= self.high


def rms_ratio(errors: ArrayLike, stds: ArrayLike) -> Estimate:
    """RMS of errors over the RMS of their standard deviations.

    The interval is that of a Gaussian's variance; without any error the ratio
    is infinite and nothing is known about it.

    Args:
        errors: (k,) in any unit.
        stds: (k,) in the same one, or one for all.

    Returns:
        The ratio, with a 95 % interval.
    """
    from scipy.stats import chi2

    errors = np.asarray(errors, dtype=float)
    if errors.size == 0:
        return Estimate(math.inf, 0.0, math.inf)
    square = float(np.mean(errors**2) / np.mean(np.square(stds)))
    low, high = chi2.interval(CONFIDENCE, errors.size) / np.array(errors.size)
    return Estimate(
        math.sqrt(square), math.sqrt(square / high), math.sqrt(square / low)
    )


def stated_ratio(stds: ArrayLike, errors: ArrayLike) -> float:
    """RMS of stated standard deviations over that of the errors; 1 is honest.

    Args:
        stds: (k,) in any unit.
        errors: (k,) in the same one.

    Returns:
        The ratio; infinite where there is no error.
    """
    rmse = float(np.sqrt(np.mean(np.square(errors))))
    return float(np.sqrt(np.mean(np.square(stds)))) / rmse if rmse else math.inf


def consistency(
    errors: NDArray[np.float64], covariances: NDArray[np.float64]
) -> Consistency:
    """Normalised errors squared, with the covariances that were stated of them.

    Args:
        errors: (k, d) in any unit.
        covariances: (k, d, d) in that unit squared.

    Returns:
        Their mean, d where the covariances are right, and the 95 % interval of that.
    """
    from scipy.stats import chi2

    count, dimension = errors.shape
    solved = np.linalg.solve(covariances, errors[:, :, None])[:, :, 0]
    low, high = chi2.interval(CONFIDENCE, dimension * count) / np.array(count)
    mean = np.einsum("ki,ki->k", errors, solved).mean()
    return Consistency(float(mean), float(low), float(high))
