"""Conversion between vectors of floats and of Drake's AutoDiffXd."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.autodiffutils import ExtractGradient, ExtractValue, InitializeAutoDiff


def seed(values: Any) -> Any:
    """Returns (n,) values as AutoDiffXd. Each value is an independent variable."""
    column: Any = np.asarray(values, dtype=float)
    return InitializeAutoDiff(column).ravel()


def value_and_gradient(
    values: Any, count: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Splits AutoDiffXd or floats into (k,) values and (k, count) derivatives.

    Derivatives of floats are zero. ``count`` is the number of independent variables.
    """
    if len(values) == 0:
        return np.empty(0), np.empty((0, count))
    column = np.asarray(values).reshape(-1, 1)
    gradient = np.asarray(ExtractGradient(column), dtype=float)
    if gradient.shape[1] == 0:
        gradient = np.zeros((len(values), count))
    return np.asarray(ExtractValue(column), dtype=float).ravel(), gradient
