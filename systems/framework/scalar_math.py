"""Makes the functions of ``systems.framework.elementary`` usable in compiled code.

The module defines numba overloads for these functions, and for the same functions of
``pydrake.math``. In compiled code, all of them call the functions of ``math``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pydrake.math
from numba import types
from numba.extending import overload, register_jitable

from systems.framework.elementary import (
    cos as cos,
    exp as exp,
    float_of as float_of,
    sin as sin,
    sqrt as sqrt,
)


@register_jitable
def _as_it_is(x: Any) -> Any:
    return x


def _compile_as(function: Callable[..., Any], compiled: Callable[..., Any]) -> None:
    """Makes compiled code call ``compiled`` instead of ``function`` for a number."""

    @overload(function, strict=False)
    def of_a_float(x: Any) -> Any:
        if isinstance(x, types.Float | types.Integer):
            return lambda x: compiled(x)  # noqa: PLW0108  # numba needs a lambda
        return None


for _name in ("cos", "sin", "exp", "sqrt"):
    _compile_as(globals()[_name], getattr(math, _name))
    _compile_as(getattr(pydrake.math, _name), getattr(math, _name))
_compile_as(float_of, _as_it_is)


@overload(pydrake.math.atan2, strict=False)
def _atan2_of_floats(y: Any, x: Any) -> Any:
    return lambda y, x: math.atan2(y, x)  # noqa: PLW0108  # numba needs a lambda
