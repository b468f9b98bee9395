"""Distributions from which a sweep draws the values of fields."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, Strict, model_validator

from systems.framework.input_error import InputError
from systems.framework.parameters import Angle, Coordinate, Length, Parameters, Point

#: Limits of the numbers. The difference of two floats within the limits is finite.
#: Integers within the limits are exact as floats.
Number = Annotated[float, Field(ge=-1e300, le=1e300)]
Integer = Annotated[int, Field(ge=-(2**53), le=2**53)]
Numbers = Annotated[tuple[Number, Number], Strict(False)]
Integers = Annotated[tuple[Integer, Integer], Strict(False)]
Values = Annotated[tuple[Any, ...], Strict(False), Field(min_length=1)]
Pairs = Annotated[tuple[Numbers, ...], Strict(False), Field(min_length=1)]
#: Number of boxes. A scenario has at most 100 obstacles.
BoxCount = Annotated[int, Field(ge=0, le=100)]
BoxCounts = Annotated[tuple[BoxCount, BoxCount], Strict(False)]
Span = Annotated[tuple[Coordinate, Coordinate], Strict(False)]
Sides = Annotated[tuple[Length, Length], Strict(False)]


def _require_order(name: str, span: tuple[float, float]) -> None:
    if span[0] > span[1]:
        raise InputError(
            name, f"{list(span)} is empty; give [low, high] with low <= high"
        )


class Boxes(Parameters):
    """Random boxes at rest. Centers and headings have uniform distributions."""

    count: BoxCounts
    """[low, high]: number of boxes, including both ends. All numbers are equally
    likely."""
    x_m: Span
    """[low, high]: x of the boxes' centers in W, m."""
    y_m: Span
    """[low, high]: y of the boxes' centers in W, m."""
    side_m: Sides
    """[low, high]: length and width of each box, drawn separately, m."""

    @model_validator(mode="after")
    def _check(self) -> Boxes:
        for name, span in self:
            _require_order(name, span)
        return self

    def draw(self, generator: np.random.Generator) -> list[dict[str, Any]]:
        """Draws boxes for the field ``obstacles``; the boxes may overlap."""
        count = int(generator.integers(*self.count, endpoint=True))
        ranges = (self.x_m, self.y_m, (-180.0, 180.0), self.side_m, self.side_m)
        low, high = np.array(ranges).T
        drawn = generator.uniform(low, high, (count, len(ranges))).tolist()
        return [
            {
                "name": f"box {k}",
                "size_m": [length, width],
                "waypoints_m": [[x, y]],
                "heading_deg": heading,
            }
            for k, (x, y, heading, length, width) in enumerate(drawn, start=1)
        ]


class Sector(Parameters):
    """Random positions, uniformly distributed over the area of a sector of a ring."""

    about_m: Point
    """(x, y) of the ring's center in W, m."""
    range_m: Sides
    """[low, high]: distance from the ring's center, m."""
    bearing_deg: Annotated[tuple[Angle, Angle], Strict(False)] = (-180.0, 180.0)
    """[low, high]: direction from the ring's center, counterclockwise from the x axis
    of W, deg."""

    @model_validator(mode="after")
    def _check(self) -> Sector:
        _require_order("range_m", self.range_m)
        _require_order("bearing_deg", self.bearing_deg)
        return self

    def draw(self, generator: np.random.Generator) -> list[float]:
        """Draws [x, y] of a position in the world frame W, m."""
        low, high = self.range_m
        distance = math.sqrt(generator.uniform(low**2, high**2))
        bearing = math.radians(generator.uniform(*self.bearing_deg))
        x, y = self.about_m
        return [x + distance * math.cos(bearing), y + distance * math.sin(bearing)]


#: Fields of ``Distribution`` that change a value but are not distributions.
_CHANGES = ("each", "either_sign")


class Distribution(Parameters):
    """A distribution, which exactly one of the fields defines.

    The fields ``each`` and ``either_sign`` define no distribution. They change the
    drawn number.
    """

    uniform: Numbers | None = None
    """[low, high]: uniform distribution between low and high."""
    log_uniform: Numbers | None = None
    """[low, high], both positive: the logarithm of the number has a uniform
    distribution between log(low) and log(high)."""
    normal: Numbers | None = None
    """[mean, standard deviation] of a normal distribution."""
    integers: Integers | None = None
    """[low, high]: whole numbers from low to high, including both. All are equally
    likely."""
    choice: Values | None = None
    """List of values of any type. All values are equally likely."""
    in_turn: Values | None = None
    """List of values of any type. Run k gets value k modulo their number, so that all
    values occur equally often."""
    boxes: Boxes | None = None
    """Random boxes at rest, for the field ``obstacles``."""
    sector: Sector | None = None
    """Random position, for fields like ``position_m``."""
    each: Pairs | None = None
    """One pair [a, b] for each path that the key lists, in the same order. If x is the
    drawn number, the field at this path gets a x + b."""
    either_sign: Literal[True] | None = None
    """If true, the sign of the drawn number changes with probability 1/2."""

    @model_validator(mode="after")
    def _check(self) -> Distribution:
        names = [name for name in type(self).model_fields if name not in _CHANGES]
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
        if name == "integers":
            _require_order(name, values)
        for change in _CHANGES:
            if getattr(self, change) is not None and not self.numeric:
                raise InputError(
                    change,
                    f"applies to numbers, and {name} does not draw numbers; remove it",
                )
        return self

    @property
    def _given(self) -> tuple[str, Any]:
        """Name and parameters of the distribution that is set."""
        return next((name, values) for name, values in self if values is not None)

    @property
    def numeric(self) -> bool:
        """Whether the distribution draws numbers; always false for lists of values."""
        return self._given[0] in ("uniform", "log_uniform", "normal", "integers")

    def draw(
        self, generator: np.random.Generator, count: int = 1, run: int = 0
    ) -> list[Any]:
        """Draws one value for a run, and returns the values of ``count`` fields.

        All fields get the drawn value, unless ``each`` has one pair for each field.
        """
        if self.in_turn is not None:
            return [self.in_turn[run % len(self.in_turn)]] * count
        if self.boxes is not None:
            return [self.boxes.draw(generator)] * count
        if self.sector is not None:
            return [self.sector.draw(generator)] * count
        if self.choice is not None:
            return [self.choice[int(generator.integers(len(self.choice)))]] * count
        value = self._number(generator)
        if self.either_sign and generator.integers(2):
            value = -value
        if self.each is None:
            return [value] * count
        return [a * value + b for a, b in self.each]

    def _number(self, generator: np.random.Generator) -> int | float:
        name, values = self._given
        low, high = values
        if name == "integers":
            return int(generator.integers(low, high, endpoint=True))
        if name == "log_uniform":
            value = math.exp(generator.uniform(math.log(low), math.log(high)))
            return min(max(value, low), high)
        draw = generator.uniform if name == "uniform" else generator.normal
        return float(draw(low, high))
