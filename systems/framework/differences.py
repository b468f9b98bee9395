"""Finite differences of a function of several numbers."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

#: Relative rounding error of a float.
EPSILON = float(np.finfo(float).eps)
#: With this step, truncation and rounding contribute about equally to the error of
#: central differences of a function whose values and derivatives are near 1.
STEP = EPSILON ** (1.0 / 3.0)


class Slopes(NamedTuple):
    """Difference quotients (n,) of a function by one element of its argument."""

    step: float
    """Step of this element."""
    near: NDArray[np.float64]
    """Central differences with this step."""
    far: NDArray[np.float64]
    """Central differences with twice the step."""
    ahead: NDArray[np.float64]
    """One-sided differences for larger values of the element."""
    behind: NDArray[np.float64]
    """One-sided differences for smaller values of the element."""


def slopes_at(
    function: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    point: NDArray[np.float64],
    here: NDArray[np.float64],
    k: int,
    step: float = STEP,
) -> Slopes:
    """Computes the differences of a function by one element of its argument.

    Args:
        function: Function of an (m,) array that returns an (n,) array.
        point: (m,) argument.
        here: (n,) value of the function at ``point``.
        k: Index of the element.
        step: Step of the element relative to its size, and absolute below 1.

    Returns:
        The differences.
    """
    h = step * max(1.0, abs(float(point[k])))

    def moved(by: float) -> NDArray[np.float64]:
        there = point.copy()
        there[k] += by
        return function(there)

    high, low, higher, lower = (moved(by) for by in (h, -h, 2.0 * h, -2.0 * h))
    return Slopes(
        step=h,
        near=(high - low) / (2.0 * h),
        far=(higher - lower) / (4.0 * h),
        ahead=(high - here) / h,
        behind=(here - low) / h,
    )
