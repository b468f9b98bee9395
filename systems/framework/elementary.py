"""Elementary functions of floats, of arrays, and of AutoDiffXd.

They are those of ``pydrake.math``, and sine and cosine of arrays those of numpy; for
floats ``math`` has the same ones in a third of the time, but raises where they are
infinite or not a number.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

# From some way above this exponent on a float is infinite.
_LARGEST_EXPONENT = 709.0


def float_of(x: Any) -> float:
    """Value of a float or an AutoDiffXd."""
    return x if isinstance(x, float) else x.value()


def cos(x: Any) -> Any:
    """Cosine of x in rad."""
    if isinstance(x, float) and math.isfinite(x):
        return math.cos(x)
    if isinstance(x, np.ndarray):
        return np.cos(x)
    return _of_drake().cos(x)


def sin(x: Any) -> Any:
    """Sine of x in rad."""
    if isinstance(x, float) and math.isfinite(x):
        return math.sin(x)
    if isinstance(x, np.ndarray):
        return np.sin(x)
    return _of_drake().sin(x)


def exp(x: Any) -> Any:
    """e to the power of x."""
    if isinstance(x, float) and x < _LARGEST_EXPONENT:
        return math.exp(x)
    return _of_drake().exp(x)


def sqrt(x: Any) -> Any:
    """Square root of x."""
    if isinstance(x, float) and x >= 0.0:
        return math.sqrt(x)
    return _of_drake().sqrt(x)


def _of_drake() -> Any:
    """Its functions; parameters are checked without Drake."""
    import pydrake.math

    return pydrake.math
