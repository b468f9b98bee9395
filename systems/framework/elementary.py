"""Computes elementary functions of floats, arrays and AutoDiffXd.

For floats, the functions of the module ``math`` give the same results as those of
``pydrake.math`` in a third of the time. However, the functions of ``math`` raise errors
if a result is infinite or NaN. In these cases, and for AutoDiffXd, this module uses
``pydrake.math``. For the sine and cosine of arrays, this module uses numpy.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

# Slightly above this exponent, the result is infinite.
_LARGEST_EXPONENT = 709.0


def float_of(x: Any) -> float:
    """Returns the value of a float or an AutoDiffXd."""
    return x if isinstance(x, float) else x.value()


def cos(x: Any) -> Any:
    """Computes the cosine of x, with x in rad."""
    if isinstance(x, float) and math.isfinite(x):
        return math.cos(x)
    if isinstance(x, np.ndarray):
        return np.cos(x)
    return _of_drake().cos(x)


def sin(x: Any) -> Any:
    """Computes the sine of x, with x in rad."""
    if isinstance(x, float) and math.isfinite(x):
        return math.sin(x)
    if isinstance(x, np.ndarray):
        return np.sin(x)
    return _of_drake().sin(x)


def exp(x: Any) -> Any:
    """Computes e to the power of x."""
    if isinstance(x, float) and x < _LARGEST_EXPONENT:
        return math.exp(x)
    return _of_drake().exp(x)


def sqrt(x: Any) -> Any:
    """Computes the square root of x."""
    if isinstance(x, float) and x >= 0.0:
        return math.sqrt(x)
    return _of_drake().sqrt(x)


def _of_drake() -> Any:
    """Imports ``pydrake.math`` late, so that parameter checks do not load Drake."""
    import pydrake.math

    return pydrake.math
