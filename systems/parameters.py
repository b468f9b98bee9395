"""What every block's parameter set has in common.

A block's parameters are one frozen pydantic model that lives in the block's
file. A scenario is a tree of these models, so each quantity has one name, one
default and one legal range, and an error names the field by its whole path.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Self

from pydantic import BaseModel, ConfigDict, Field, Strict

__all__ = [
    "Fraction",
    "NonNegative",
    "Parameters",
    "Point",
    "Positive",
    "Size",
]

Positive = Annotated[float, Field(gt=0.0)]
NonNegative = Annotated[float, Field(ge=0.0)]
Fraction = Annotated[float, Field(ge=0.0, le=1.0)]

# YAML knows lists only, hence the one exception to strict types.
Point = Annotated[tuple[float, float], Strict(False)]
Size = Annotated[tuple[Positive, Positive], Strict(False)]


class Parameters(BaseModel):
    """Frozen, strictly typed, no unknown keys, no NaN and no infinity."""

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        strict=True,
        allow_inf_nan=False,
        use_attribute_docstrings=True,
    )

    def model_copy(
        self, *, update: Mapping[str, Any] | None = None, deep: bool = False
    ) -> Self:
        """A copy with some fields changed; cached properties are worked out anew."""
        copied = super().model_copy(update=update, deep=deep)
        for name in copied.__dict__.keys() - type(self).model_fields.keys():
            del copied.__dict__[name]
        return copied
