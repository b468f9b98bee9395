"""A further loudspeaker: where it is, and which fields are refused."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from systems.base.source_robot import SourceRobot
from systems.sound.interferers import InterfererParameters


def test_it_moves_along_its_waypoints():
    """At 0.5 m/s, less v^2 / 2a for the start."""
    fan = InterfererParameters(waypoints_m=((0.0, 1.0), (4.0, 1.0)), speed_m_s=0.5)
    block = SourceRobot(source=fan, suffix="_fan").ToAutoDiffXd()
    context = block.CreateDefaultContext()
    context.SetTime(3.0)
    pose = block.GetOutputPort("pose_WS_fan").Eval(context)
    assert [element.value() for element in pose] == pytest.approx(
        [1.5 - 0.125, 1.0, 0.0], abs=1e-4
    )


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"name": "fan 1"}, "name"),
        ({"waypoints_m": ()}, r"waypoints_m: none"),
        ({"sound": {"kind": "wav"}}, r"sound\s"),
    ],
)
def test_bad_parameters(fields, message):
    with pytest.raises(ValidationError, match=message):
        InterfererParameters.model_validate(fields)
