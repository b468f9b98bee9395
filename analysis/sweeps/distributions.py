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
        for name, low_high in (
            ("uniform", self.uniform),
            ("log_uniform", self.log_uniform),
        ):
            if low_high is not None and not low_high[0] < low_high[1]:
                raise InputError(
                    name,
                    f"{list(low_high)} is empty; give [low, high] with low < "
                    "high, or use set for one value",
                )
        if self.log_uniform is not None and self.log_uniform[0] <= 0.0:
            raise InputError(
                "log_uniform", f"{list(self.log_uniform)} must be positive; raise low"
            )
        if self.normal is not None and self.normal[1] <= 0.0:
            raise InputError(
                "normal",
                f"the standard deviation {self.normal[1]:g} must be positive; "
                "give [mean, standard deviation]",
            )
        if self.integers is not None and self.integers[0] > self.integers[1]:
            raise InputError(
                "integers",
                f"{list(self.integers)} is empty; give [low, high] with low <= high",
            )
        return self

    @property
    def numeric(self) -> bool:
        """Whether what is drawn has an order: all but ``choice``."""
        return self.choice is None

    def draw(self, generator: np.random.Generator) -> Any:
        """One value, of a plain type."""
        if self.uniform is not None:
            return float(generator.uniform(*self.uniform))
        if self.log_uniform is not None:
            low, high = self.log_uniform
            value = math.exp(generator.uniform(math.log(low), math.log(high)))
            return min(max(value, low), high)
        if self.normal is not None:
            return float(generator.normal(*self.normal))
        if self.integers is not None:
            low_int, high_int = self.integers
            return int(generator.integers(low_int, high_int, endpoint=True))
        values = self.choice or ()
        return values[int(generator.integers(len(values)))]
