"""What a sweep draws the value of a field from."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, Strict, model_validator

from systems.framework.input_error import InputError
from systems.framework.parameters import (
    Angle,
    Coordinate,
    Length,
    Parameters,
    Point,
)

#: Differences of such numbers are finite, and such integers are exact as floats.
Number = Annotated[float, Field(ge=-1e300, le=1e300)]
Integer = Annotated[int, Field(ge=-(2**53), le=2**53)]
Numbers = Annotated[tuple[Number, Number], Strict(False)]
Integers = Annotated[tuple[Integer, Integer], Strict(False)]
Values = Annotated[tuple[Any, ...], Strict(False), Field(min_length=1)]
Pairs = Annotated[tuple[Numbers, ...], Strict(False), Field(min_length=1)]
#: As many as a scenario may have.
BoxCount = Annotated[int, Field(ge=0, le=100)]
BoxCounts = Annotated[tuple[BoxCount, BoxCount], Strict(False)]
Span = Annotated[tuple[Coordinate, Coordinate], Strict(False)]
Sides = Annotated[tuple[Length, Length], Strict(False)]


class Boxes(Parameters):
    """Resting boxes of any heading, evenly scattered over a rectangle."""

    count: BoxCounts
    """[low, high]: how many, both ends included, each as likely."""
    x_m: Span
    """[low, high]: where their centres lie along x of W, m."""
    y_m: Span
    """[low, high]: where their centres lie along y of W, m."""
    side_m: Sides
    """[low, high]: both extents of each, m."""

    @model_validator(mode="after")
    def _check(self) -> Boxes:
        for name, (low, high) in self:
            if low > high:
                raise InputError(
                    name, f"{[low, high]} is empty; give [low, high] with low <= high"
                )
        return self

    def draw(self, generator: np.random.Generator) -> list[dict[str, Any]]:
        """A value for ``obstacles`` of a scenario; boxes may overlap.

        Args:
            generator: Where the numbers come from.

        Returns:
            Fields of ``ObstacleParameters`` of each, with names of their own.
        """
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
    """Points evenly spread over the area of a sector of a ring."""

    about_m: Point
    """Middle of the ring in W, m."""
    range_m: Sides
    """[low, high]: distance from it, m."""
    bearing_deg: Annotated[tuple[Angle, Angle], Strict(False)] = (-180.0, 180.0)
    """[low, high]: CCW from the x axis of W, deg."""

    @model_validator(mode="after")
    def _check(self) -> Sector:
        for name in ("range_m", "bearing_deg"):
            low, high = getattr(self, name)
            if low > high:
                raise InputError(
                    name, f"{[low, high]} is empty; give [low, high] with low <= high"
                )
        return self

    def draw(self, generator: np.random.Generator) -> list[float]:
        """A place.

        Args:
            generator: Where the numbers come from.

        Returns:
            x and y in W, m.
        """
        low, high = self.range_m
        distance = math.sqrt(generator.uniform(low**2, high**2))
        bearing = math.radians(generator.uniform(*self.bearing_deg))
        x, y = self.about_m
        return [x + distance * math.cos(bearing), y + distance * math.sin(bearing)]


#: Fields of a distribution that are none themselves.
_CHANGES = ("each", "either_sign")


class Distribution(Parameters):
    """One distribution; ``each`` and ``either_sign`` change what it draws."""

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
    boxes: Boxes | None = None
    """A list of resting boxes, for ``obstacles``."""
    sector: Sector | None = None
    """A place, for ``position_m`` and its like."""
    each: Pairs | None = None
    """[a, b] for each path of the key, in its order: it gets a times the number that
    was drawn, plus b."""
    either_sign: Literal[True] | None = None
    """The number or its negative, each as likely."""

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
        if name == "integers" and values[0] > values[1]:
            raise InputError(
                name, f"{list(values)} is empty; give [low, high] with low <= high"
            )
        for change in _CHANGES:
            if getattr(self, change) is not None and not self.numeric:
                raise InputError(
                    change,
                    f"applies to numbers, and {name} does not draw numbers; remove it",
                )
        return self

    @property
    def _given(self) -> tuple[str, Any]:
        """The one distribution that is set, and its values."""
        return next((name, values) for name, values in self if values is not None)

    @property
    def numeric(self) -> bool:
        """Whether what is drawn has an order, as numbers have."""
        return self.choice is None and self.boxes is None and self.sector is None

    def draw(self, generator: np.random.Generator, count: int = 1) -> list[Any]:
        """Draws once.

        Args:
            generator: Where the numbers come from.
            count: Of paths that get a value; as many as ``each`` has entries.

        Returns:
            What each path gets, of plain types.
        """
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
