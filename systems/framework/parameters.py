"""What every block's parameter set has in common.

A block's parameters are one frozen pydantic model, in ``parameters.py`` of its room:
scenarios are checked without Drake and compiled code. A scenario is a tree of these
models, so each quantity has one name, one default and one legal range, and an error
names the field by its whole path.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Self

from pydantic import BaseModel, ConfigDict, Field, Strict

# Every quantity has a range that a robot on a floor can have, with decades to spare:
# what lies outside is a slip of the pen, and would overflow or never end. Where a
# field needs a narrower range, it says so itself.
_LARGEST_M = 1_000.0
_DAY_S = 86_400.0
_LARGEST = 1e6

Positive = Annotated[float, Field(ge=1e-9, le=_LARGEST)]
NonNegative = Annotated[float, Field(ge=0.0, le=_LARGEST)]
Fraction = Annotated[float, Field(ge=0.0, le=1.0)]

Length = Annotated[float, Field(ge=1e-9, le=_LARGEST_M)]
NonNegativeLength = Annotated[float, Field(ge=0.0, le=_LARGEST_M)]
Coordinate = Annotated[float, Field(ge=-_LARGEST_M, le=_LARGEST_M)]
Angle = Annotated[float, Field(ge=-3_600.0, le=3_600.0)]
Duration = Annotated[float, Field(ge=1e-9, le=_DAY_S)]
Time = Annotated[float, Field(ge=0.0, le=_DAY_S)]
Period = Annotated[float, Field(ge=1e-3, le=1.0)]
Speed = Annotated[float, Field(ge=1e-3, le=100.0)]
NonNegativeSpeed = Annotated[float, Field(ge=0.0, le=100.0)]
Acceleration = Annotated[float, Field(ge=1e-3, le=_LARGEST)]
SoundSpeed = Annotated[float, Field(ge=50.0, le=10_000.0)]
Frequency = Annotated[float, Field(ge=1.0, le=1e6)]
Mass = Annotated[float, Field(ge=1e-3, le=10_000.0)]
Stiffness = Annotated[float, Field(ge=1e-9, le=_LARGEST)]
NonNegativeStiffness = Annotated[float, Field(ge=0.0, le=_LARGEST)]
Damping = Annotated[float, Field(ge=1e-9, le=_LARGEST)]
NonNegativeDamping = Annotated[float, Field(ge=0.0, le=_LARGEST)]

# YAML knows lists only, hence the one exception to strict types.
Point = Annotated[tuple[Coordinate, Coordinate], Strict(False)]
Waypoints = Annotated[tuple[Point, ...], Strict(False), Field(max_length=1_000)]
Size = Annotated[tuple[Length, Length], Strict(False)]


class Parameters(BaseModel):
    """Frozen, strictly typed, no unknown keys, no NaN and no infinity.

    The docstring of a field says what it means, and in which unit; see ``meanings``.
    """

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        strict=True,
        allow_inf_nan=False,
    )

    def model_copy(
        self, *, update: Mapping[str, Any] | None = None, deep: bool = False
    ) -> Self:
        """A copy with some fields changed; cached properties are worked out anew.

        Args:
            update: New values by field; they are not validated.
            deep: Whether values are copied as well.

        Returns:
            A parameter set of the same class.
        """
        copied = super().model_copy(update=update, deep=deep)
        for name in copied.__dict__.keys() - type(self).model_fields.keys():
            del copied.__dict__[name]
        return copied


def with_preset(data: Any, presets: Mapping[str, Mapping[str, Any]]) -> Any:
    """Input of a model that has a field ``preset``, filled up from that preset.

    Args:
        data: As pydantic gives it to a validator before all others.
        presets: Fields by the preset's name.

    Returns:
        The input, in which what was given wins.
    """
    name = data.get("preset") if isinstance(data, Mapping) else None
    if isinstance(name, str):  # of any other type it is refused later
        return {**presets.get(name, {}), **data}
    return data
