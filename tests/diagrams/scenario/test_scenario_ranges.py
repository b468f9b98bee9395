"""Every number of a scenario has a range: nothing overflows, nothing never ends."""

from __future__ import annotations

import math
import typing
from collections.abc import Iterator
from typing import Annotated, Any

import pytest
from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from diagrams.scenario.participants import SourceParameters
from diagrams.scenario.scenario import Scenario
from systems.sound.parameters import RoomParameters
from systems.world.parameters import ObstacleParameters

Number = tuple[str, type, list[Any]]


def numbers(model: type[BaseModel], path: str = "") -> Iterator[Number]:
    """Path, type and constraints of every number in a tree of models."""
    for name, info in model.model_fields.items():
        yield from leaves(info.annotation, info.metadata, f"{path}{name}")


def leaves(kind: Any, constraints: list[Any], path: str) -> Iterator[Number]:
    origin = typing.get_origin(kind)
    if origin is Annotated:
        inner, *added = typing.get_args(kind)
        yield from leaves(inner, [*constraints, *flat(added)], path)
    elif origin is not None:
        for inner in typing.get_args(kind):
            yield from leaves(inner, constraints, path)
    elif isinstance(kind, type) and issubclass(kind, BaseModel):
        yield from numbers(kind, f"{path}.")
    elif kind in (float, int):
        yield path, kind, constraints


def flat(constraints: list[Any]) -> list[Any]:
    """A ``Field`` within ``Annotated`` carries a list of its own."""
    found: list[Any] = []
    for each in constraints:
        found += each.metadata if isinstance(each, FieldInfo) else [each]
    return found


def bounds(constraints: list[Any]) -> tuple[float, float]:
    low, high = -math.inf, math.inf
    for each in constraints:
        for name in ("ge", "gt"):
            low = max(low, getattr(each, name, low))
        for name in ("le", "lt"):
            high = min(high, getattr(each, name, high))
    return low, high


ALL = list(numbers(Scenario))


def test_every_number_is_bounded_on_both_sides():
    assert len(ALL) > 100
    open_ended = [
        f"{path}: {bounds(constraints)}"
        for path, _, constraints in ALL
        if not all(map(math.isfinite, bounds(constraints)))
    ]
    assert open_ended == []


def test_no_quantity_that_must_be_positive_may_be_as_good_as_zero():
    """1e-300 m is positive, and overflows whatever divides by it."""
    for path, kind, constraints in ALL:
        low, _ = bounds(constraints)
        excluded = any(getattr(each, "gt", None) == low for each in constraints)
        if kind is float and low == 0.0 and excluded:
            high = bounds(constraints)[1]
            assert high <= 90.0, path


@pytest.mark.parametrize(
    ("model", "field", "value"),
    [
        (Scenario, "duration_s", 1e9),
        (Scenario, "arena_m", (1e9, 7.0)),
        (Scenario, "obstacles", ({},) * 101),
        (RoomParameters, "size_m", (1e6, 7.0, 3.0)),
        (ObstacleParameters, "waypoints_m", ((1e300, 0.0),)),
        (SourceParameters, "waypoints_m", ((0.0, 0.0),) * 1_001),
    ],
)
def test_what_would_never_end_is_refused(model, field, value):
    with pytest.raises(ValidationError, match=field):
        model.model_validate({field: value})
