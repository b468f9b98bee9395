"""A step as compiled loops do it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numba import njit

from systems.framework.compiling import njit as cached_njit


@pytest.fixture(scope="session")
def compiled_tick() -> Callable[..., None]:
    """``tick(step, tick, state, inputs, outputs, numbers)``, in compiled code.

    Inputs and outputs are tuples of arrays.
    """
    made: dict[Any, Any] = {}

    def tick(step: Any, *arguments: Any) -> None:
        if step not in made:
            compiled = cached_njit(step, cache=True)

            @njit
            def call(number, state, inputs, outputs, numbers):
                compiled(number, state, inputs, outputs, numbers)

            made[step] = call
        number, state, inputs, outputs, numbers = arguments
        for values in outputs:
            values[:] = 0.0
        arrays = tuple(np.asarray(values, dtype=float) for values in inputs)
        made[step](number, state, arrays, outputs, numbers)

    return tick
