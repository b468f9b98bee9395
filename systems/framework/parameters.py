"""Defines the base class of all parameter models, and the types of their fields.

The parameters of a block are one frozen pydantic model, in the file ``parameters.py``
of the block's folder. These files import neither Drake nor compiled code, so that a
scenario can be checked without both. A scenario is a tree of parameter models. Each
quantity therefore has one name, one default and one range, and an error message
contains the full path of the field.
"""

from __future__ import annotations

import unicodedata
from collections.abc import Mapping
from typing import Annotated, Any, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, Strict

from systems.framework.input_error import InputError

# The ranges are decades wider than any robot on a floor needs. A value outside its
# range is a typing error. Such a value would cause an overflow or an endless run. A
# field that needs a narrower range defines its own range.
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

# YAML has lists, but no tuples. Therefore these types are not strict.
Point = Annotated[tuple[Coordinate, Coordinate], Strict(False)]
Waypoints = Annotated[tuple[Point, ...], Strict(False), Field(max_length=1_000)]
Times = Annotated[tuple[Time, ...], Strict(False), Field(max_length=1_000)]
Size = Annotated[tuple[Length, Length], Strict(False)]

#: Categories of characters that change a terminal, end a line, or reverse a text.
_CONTROL = {"Cc", "Zl", "Zp"}
_BIDIRECTIONAL = {*"\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069"}


def _of_one_line(text: str) -> str:
    for letter in text:
        if unicodedata.category(letter) in _CONTROL or letter in _BIDIRECTIONAL:
            code = f"U+{ord(letter):04X}"
            raise InputError("", f"has the control character {code}; leave it out")
    return text


#: A text for names and titles: one line without control characters.
Line = Annotated[
    str,
    AfterValidator(_of_one_line),
    Field(json_schema_extra={"pattern": r"^[^\x00-\x1f\x7f-\x9f]*$"}),
]


class Parameters(BaseModel):
    """A frozen pydantic model that does not convert types.

    The model accepts no unknown keys, no NaN and no infinity. The docstring of a field
    states its meaning and its unit, see ``meanings``.
    """

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        strict=True,
        allow_inf_nan=False,
    )

    def __eq__(self, other: object) -> bool:
        """Compares the fields, and not the cached properties, which may be arrays."""
        if type(self) is not type(other):
            return NotImplemented
        mine, theirs = self.__dict__, other.__dict__
        return all(mine[name] == theirs[name] for name in type(self).model_fields)

    def __hash__(self) -> int:
        values = (self.__dict__[name] for name in type(self).model_fields)
        return hash((type(self), *values))

    def __setattr__(self, name: str, value: Any) -> None:
        """Refuses every assignment, because results belong to unchanged parameters."""
        if name.startswith("_"):
            super().__setattr__(name, value)
            return
        raise InputError(
            name,
            "cannot be assigned; make a changed copy, for example "
            "scenario.with_(law='active', **{'source.speed_m_s': 0.2})",
        )

    def model_copy(
        self, *, update: Mapping[str, Any] | None = None, deep: bool = False
    ) -> Self:
        """Copies the model and changes some fields.

        The copy recomputes its cached properties.

        Args:
            update: New values by field. They are not validated.
            deep: Whether to copy the values of the fields, too.

        Returns:
            A model of the same class.
        """
        copied = super().model_copy(update=update, deep=deep)
        for name in copied.__dict__.keys() - type(self).model_fields.keys():
            del copied.__dict__[name]
        return copied


def with_preset(data: Any, presets: Mapping[str, Mapping[str, Any]]) -> Any:
    """Adds the values of a named preset to the input of a parameter model.

    The field ``preset`` of the input names the preset.

    Args:
        data: Input of a pydantic validator with the mode ``before``.
        presets: Values of fields, by the name of the preset.

    Returns:
        The completed input. Values in ``data`` override those of the preset.
    """
    name = data.get("preset") if isinstance(data, Mapping) else None
    if isinstance(name, str):  # a later check rejects any other type
        return {**presets.get(name, {}), **data}
    return data
