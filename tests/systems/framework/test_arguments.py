"""Constructors of blocks: dictionaries as parameters, messages and signatures."""

from __future__ import annotations

import inspect

import pytest

import systems
from systems import CollisionVector, CollisionVector_, TDOAEstimator, WheelCommand
from systems.framework.input_error import InputError
from systems.ranging.parameters import UltrasonicParameters


def test_a_dictionary_is_validated_like_a_scenario():
    fields = {"sensors": [{"axis_deg": 50}, {"axis_deg": -50}], "firing": "sequential"}
    given = CollisionVector(sensors=fields)
    made = CollisionVector(sensors=UltrasonicParameters.model_validate(fields))
    assert given.step.numbers == made.step.numbers
    assert given.ToAutoDiffXd().step.numbers == made.step.numbers
    assert CollisionVector(sensors={"axes_deg": [45, 0, -45]}).step.numbers.axes == (
        pytest.approx([0.7853981633974483, 0.0, -0.7853981633974483])
    )
    wheel = WheelCommand(robot={"wheel_radius_m": 0.1}).step.numbers
    assert wheel.robot.wheel_radius_m == 0.1


@pytest.mark.parametrize(
    ("block", "arguments", "message"),
    [
        (
            "CollisionVector",
            {"sensors": {"axis": 3}},
            "sensors.axis: is no field",
        ),
        (
            "CollisionVector",
            {"sensors": {"axes_deg": [45, 50]}},
            "sensors.sensors.1.axis_deg: 50 must be below 45",
        ),
        (
            "CollisionVector",
            {"sensors": 3},
            r"sensors: is 3; write sensors=UltrasonicParameters\(...\), or sensors={'",
        ),
        ("TDOAEstimator", {"robot": {"length": 3}}, "robot.length: is no field"),
        ("TDOAEstimator", {"robot": {"length_m": "a"}}, "robot.length_m: is 'a'; inp"),
    ],
)
def test_other_arguments_are_refused_with_the_line_to_type(block, arguments, message):
    with pytest.raises(InputError, match=f"^{message}"):
        getattr(systems, block)(**arguments)


def test_signatures_list_the_arguments():
    names = ["parameters", "sensors", "robot", "initial_pose", "tick_s"]
    assert [*inspect.signature(CollisionVector).parameters] == names
    assert [*inspect.signature(CollisionVector_).parameters] == names
    made = inspect.signature(CollisionVector.__init__)
    assert [*made.parameters] == ["self", *names]
    assert "robot" in inspect.signature(TDOAEstimator).parameters
    with pytest.raises(TypeError, match=r"^CollisionVector\(\) got .* 'sensor'"):
        CollisionVector(sensor=3)
