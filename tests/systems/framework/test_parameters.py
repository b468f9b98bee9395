"""Parameter sets: frozen, strict, finite, documented."""

from __future__ import annotations

import math
from typing import Any, get_args

import pytest
from hypothesis import given, strategies as st
from pydantic import ValidationError

from diagrams.scenario.participants import KINDS
from diagrams.scenario.scenario import Scenario
from systems.base.robot import RobotParameters
from systems.framework.input_error import InputError
from systems.framework.meanings import meanings
from systems.framework.parameters import (
    Fraction,
    NonNegative,
    Parameters,
    Point,
    Positive,
    Size,
)
from systems.laws.active import ActiveParameters
from systems.ranging.parameters import RangeSensorParameters, UltrasonicParameters
from systems.sound.acoustics import sound_speed


class Example(Parameters):
    radius: Positive = 1.0
    lag: NonNegative = 0.0
    part: Fraction = 0.5
    place: Point = (0.0, 0.0)
    extent: Size = (1.0, 1.0)
    count: int = 1


def models(model: type[Parameters]) -> set[type[Parameters]]:
    """The models of the tree below a model, itself included."""
    found = {model}
    for info in model.model_fields.values():
        found |= models_in(info.annotation)
    return found


def models_in(annotation: Any) -> set[type[Parameters]]:
    if isinstance(annotation, type) and issubclass(annotation, Parameters):
        return models(annotation)
    return {m for argument in get_args(annotation) for m in models_in(argument)}


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("radius", 0.0),
        ("radius", -1.0),
        ("radius", "1"),
        ("radius", True),
        ("radius", None),
        ("lag", -1e-300),
        ("part", 1.0000001),
        ("part", -0.1),
        ("place", (1.0,)),
        ("place", (1.0, 2.0, 3.0)),
        ("place", (1.0, math.nan)),
        ("extent", (1.0, 0.0)),
        ("count", 1.5),
        ("count", True),
        ("radios", 1.0),
    ],
)
def test_refuses(field, value):
    with pytest.raises(ValidationError) as caught:
        Example.model_validate({field: value})
    assert caught.value.errors()[0]["loc"][0] == field


@given(st.sampled_from(["radius", "lag", "part"]), st.sampled_from([1, -1]))
def test_no_nan_and_no_infinity(field, sign):
    for value in (math.nan, sign * math.inf):
        with pytest.raises(ValidationError, match="finite"):
            Example.model_validate({field: value})


@given(st.floats(min_value=1e-9, max_value=1e6))
def test_positive_takes_every_number_in_range_as_it_is(value):
    assert Example(radius=value).radius == value


def test_lists_of_yaml_become_tuples():
    example = Example.model_validate({"place": [1, 2.5], "extent": [0.5, 2]})
    assert example.place == (1.0, 2.5)
    assert example.extent == (0.5, 2.0)


def test_frozen():
    with pytest.raises(InputError, match="radius: cannot be assigned"):
        Example().radius = 2.0


def test_every_quantity_of_a_scenario_is_documented():
    """A group of a scenario or of its robots is documented by its own model."""
    trees, owners = models(Scenario), {Scenario, *KINDS.values()}
    assert trees > owners
    assert len(trees) >= 17, "the walk must find the blocks' parameters"
    bare = [
        f"{model.__name__}.{name}"
        for model in trees
        for name in model.model_fields.keys() - meanings(model)
        if model not in owners or not models_in(model.model_fields[name].annotation)
    ]
    assert bare == []


def test_robot_of_table_6():
    robot = RobotParameters()
    assert robot.top_wheel_speed == pytest.approx(12.0)  # 0.72 / 0.06
    assert robot.control_point_m == robot.length_m / 2
    assert max(y for _, y in robot.microphones_m) <= robot.width_m / 2


@pytest.mark.parametrize(
    ("places", "message"),
    [
        (((0.0, 0.4), (0.0, -0.4)), "at least 3"),
        (((0.0, 0.4), (0.0, 0.0), (0.0005, 0.4)), r"microphones_m: .*0 and 2"),
    ],
)
def test_microphones_that_are_no_array(places, message):
    with pytest.raises(ValidationError, match=message):
        RobotParameters(microphones_m=places)


@pytest.mark.parametrize(
    ("temperature", "speed"), [(0.0, 331.5), (20.0, 343.5), (-10.0, 325.5)]
)
def test_sound_speed(temperature, speed):
    assert sound_speed(temperature) == pytest.approx(speed)


def test_a_changed_copy_keeps_nothing_that_was_worked_out():
    """Decay length and cones hang on fields that the copies change."""
    gains = ActiveParameters()
    sensors = UltrasonicParameters()
    assert gains.alpha_m > 0.0
    assert len(sensors.beams[2]) == 3
    reach = gains.model_copy(update={"reach_m": 2.0 * gains.reach_m})
    assert reach.alpha_m == pytest.approx(2.0 * gains.alpha_m)
    wide = RangeSensorParameters(beam_half_angle_deg=30.0)
    changed = sensors.model_copy(update={"sensors": (wide,)})
    assert changed.beams[2].tolist() == pytest.approx([math.pi / 6.0])
