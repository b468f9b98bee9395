"""Elementary functions of floats, and of AutoDiffXd where there are derivatives.

On floats they are those of ``math``, in a third of the time of ``pydrake.math``.
"""

from __future__ import annotations

import math
from typing import Any

import pydrake.math

__all__ = ["cos", "exp", "sin", "sqrt"]


def cos(x: Any) -> Any:
    """Cosine of x in rad."""
    return math.cos(x) if type(x) is float else pydrake.math.cos(x)


def sin(x: Any) -> Any:
    """Sine of x in rad."""
    return math.sin(x) if type(x) is float else pydrake.math.sin(x)


def exp(x: Any) -> Any:
    """e to the power of x."""
    return math.exp(x) if type(x) is float else pydrake.math.exp(x)


def sqrt(x: Any) -> Any:
    """Square root of x, which is not negative."""
    return math.sqrt(x) if type(x) is float else pydrake.math.sqrt(x)
