"""Seeds and gradients of vectors of AutoDiffXd."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.autodiffutils import ExtractGradient, ExtractValue, InitializeAutoDiff


def seed(values: Any) -> Any:
    """The values as AutoDiffXd, each its own variable; (n,)."""
    column: Any = np.asarray(values, dtype=float)
    return InitializeAutoDiff(column).ravel()


def value_and_gradient(
    values: Any, count: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Values and gradients of AutoDiffXd.

    Args:
        values: (k,) floats or AutoDiffXd.
        count: Number n of variables; a value without derivatives has zeros.

    Returns:
        (k,) values and (k, n) derivatives, in the units of the values.
    """
    if len(values) == 0:
        return np.empty(0), np.empty((0, count))
    column = np.asarray(values).reshape(-1, 1)
    gradient = np.asarray(ExtractGradient(column), dtype=float)
    if gradient.shape[1] == 0:
        gradient = np.zeros((len(values), count))
    return np.asarray(ExtractValue(column), dtype=float).ravel(), gradient
