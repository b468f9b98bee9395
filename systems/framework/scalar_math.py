"""Elementary functions of floats, and of AutoDiffXd where there are derivatives.

Compiled code may call them, and those of ``pydrake.math``, too: of floats they are
those of ``math``.

They are those of ``pydrake.math``, and sine and cosine of arrays those of numpy; for
floats ``math`` has the same ones in a third of the time, but raises where they are
infinite or not a number.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pydrake.math
from numba import types
from numba.extending import overload, register_jitable

__all__ = ["cos", "exp", "float_of", "sin", "sqrt"]

# From some way above this exponent on a float is infinite.
_LARGEST_EXPONENT = 709.0


@register_jitable
def _as_it_is(x: Any) -> Any:
    return x


def float_of(x: Any) -> float:
    """Value of a float or an AutoDiffXd."""
    return x if isinstance(x, float) else x.value()


def cos(x: Any) -> Any:
    """Cosine of x in rad."""
    if type(x) is float and math.isfinite(x):
        return math.cos(x)
    if isinstance(x, np.ndarray):
        return np.cos(x)
    return pydrake.math.cos(x)


def sin(x: Any) -> Any:
    """Sine of x in rad."""
    if type(x) is float and math.isfinite(x):
        return math.sin(x)
    if isinstance(x, np.ndarray):
        return np.sin(x)
    return pydrake.math.sin(x)


def exp(x: Any) -> Any:
    """e to the power of x."""
    if type(x) is float and x < _LARGEST_EXPONENT:
        return math.exp(x)
    return pydrake.math.exp(x)


def sqrt(x: Any) -> Any:
    """Square root of x."""
    if type(x) is float and x >= 0.0:
        return math.sqrt(x)
    return pydrake.math.sqrt(x)


def _compile_as(function: Callable[..., Any], compiled: Callable[..., Any]) -> None:
    """Compiled code that calls a function of a float calls another one."""

    @overload(function, strict=False)
    def of_a_float(x: Any) -> Any:
        if isinstance(x, types.Float | types.Integer):
            return lambda x: compiled(x)  # noqa: PLW0108  # numba wants its own
        return None


for _name in ("cos", "sin", "exp", "sqrt"):
    _compile_as(globals()[_name], getattr(math, _name))
    _compile_as(getattr(pydrake.math, _name), getattr(math, _name))
_compile_as(float_of, _as_it_is)


@overload(pydrake.math.atan2, strict=False)
def _atan2_of_floats(y: Any, x: Any) -> Any:
    return lambda y, x: math.atan2(y, x)  # noqa: PLW0108  # numba wants its own
