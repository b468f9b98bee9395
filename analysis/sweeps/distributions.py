"""What a sweep draws the value of a field from."""

from __future__ import annotations

import math
from typing import Annotated, Any

import numpy as np
from pydantic import Field, Strict, model_validator

from systems.framework.input_error import InputError
from systems.framework.parameters import Parameters

__all__ = ["Distribution"]

#: Differences of such numbers are finite, and such integers are exact as floats.
Number = Annotated[float, Field(ge=-1e300, le=1e300)]
Integer = Annotated[int, Field(ge=-(2**53), le=2**53)]
Numbers = Annotated[tuple[Number, Number], Strict(False)]
Integers = Annotated[tuple[Integer, Integer], Strict(False)]
Values = Annotated[tuple[Any, ...], Strict(False), Field(min_length=1)]


class Distribution(Parameters):
    """One distribution: exactly one of the fields is set."""

    uniform: Numbers | None = None
    """[low, high]: even between them."""
    log_uniform: Numbers | None = None
    """[low, high], both positive: the logarithm is even between theirs."""
    normal: Numbers | None = None
    """[mean, standard deviation]."""
    integers: Integers | None = None
    """[low, high]: whole numbers, both ends included, each as likely."""
    choice: Values | None = None
    """Values of any kind, each as likely."""

    @model_validator(mode="after")
    def _check(self) -> Distribution:
        names = list(type(self).model_fields)
        given = [name for name in names if getattr(self, name) is not None]
        if len(given) != 1:
            raise InputError(
                "",
                f"{len(given)} distributions are given; give one of {', '.join(names)}",
            )
        name, values = self._given
        if name in ("uniform", "log_uniform") and not values[0] < values[1]:
            raise InputError(
                name,
                f"{list(values)} is empty; give [low, high] with low < "
                "high, or use set for one value",
            )
        if name == "log_uniform" and values[0] <= 0.0:
            raise InputError(name, f"{list(values)} must be positive; raise low")
        if name == "normal" and values[1] <= 0.0:
            raise InputError(
                name,
                f"the standard deviation {values[1]:g} must be positive; "
                "give [mean, standard deviation]",
            )
        if name == "integers" and values[0] > values[1]:
            raise InputError(
                name, f"{list(values)} is empty; give [low, high] with low <= high"
            )
        return self

    @property
    def _given(self) -> tuple[str, tuple[Any, ...]]:
        """The one field that is set, and its values."""
        return next((name, values) for name, values in self if values is not None)

    @property
    def numeric(self) -> bool:
        """Whether what is drawn has an order: all but ``choice``."""
        return self.choice is None

    def draw(self, generator: np.random.Generator) -> Any:
        """One value, of a plain type."""
        name, values = self._given
        if name == "choice":
            return values[int(generator.integers(len(values)))]
        low, high = values
        if name == "integers":
            return int(generator.integers(low, high, endpoint=True))
        if name == "log_uniform":
            value = math.exp(generator.uniform(math.log(low), math.log(high)))
            return min(max(value, low), high)
        draw = generator.uniform if name == "uniform" else generator.normal
        return float(draw(low, high))
