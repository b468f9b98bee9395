"""The master robot's ports against the motion that was asked for."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pydantic import ValidationError
from pydrake.autodiffutils import AutoDiffXd

from phonotaxis.testing import Bench, evaluate
from systems.base.carrier_parameters import SourceRobotParameters
from systems.base.source_robot import SourceRobot

pytestmark = pytest.mark.drake

STRAIGHT = SourceRobotParameters(
    waypoints_m=((1.0, 2.0), (1.0, 5.0)), speed_m_s=0.2, start_time_s=1.0
)


#: What a ramp of 1 m/s^2 up to 0.2 m/s costs, v^2 / 2a.
RAMP_M = 0.02


def test_straight_line():
    """5 s of it; the drive has settled on its path."""
    outputs = evaluate(SourceRobot(source=STRAIGHT), time_s=6.0)
    expected = [1.0, 3.0 - RAMP_M, math.pi / 2]
    np.testing.assert_allclose(outputs["pose_WS"], expected, atol=1e-6)
    np.testing.assert_allclose(outputs["v_WS"], [0.0, 0.2, 0.0], atol=1e-6)


def test_it_does_not_step_to_its_speed():
    outputs = evaluate(SourceRobot(source=STRAIGHT), time_s=1.1)
    np.testing.assert_allclose(outputs["v_WS"], [0.0, 0.1, 0.0], atol=5e-3)


def test_outputs_follow_time_in_one_context():
    at = Bench(SourceRobot(source=STRAIGHT), time_s=6.0)
    at.output("pose_WS")
    at.context.SetTime(11.0)
    assert at.output("pose_WS")[1] == pytest.approx(4.0 - RAMP_M)


def test_rests_by_default_2_m_ahead():
    outputs = evaluate(SourceRobot(), time_s=100.0)
    np.testing.assert_array_equal(outputs["pose_WS"], [2.0, 0.0, 0.0])
    np.testing.assert_array_equal(outputs["v_WS"], np.zeros(3))


def test_heading_of_a_source_at_rest():
    source = SourceRobotParameters(heading_deg=90.0)
    pose = evaluate(SourceRobot(source=source))["pose_WS"]
    assert pose[2] == pytest.approx(math.pi / 2)


def test_converted_block_moves_alike_and_carries_no_gradient():
    """The source is exogenous: time is no variable of the linearization."""
    converted = Bench(SourceRobot(source=STRAIGHT).ToAutoDiffXd())
    converted.context.SetTime(AutoDiffXd(6.0, 1, 0))
    pose = converted.output("pose_WS")
    expected = pytest.approx([1.0, 3.0 - RAMP_M, math.pi / 2])
    assert [x.value() for x in pose] == expected
    assert all(not np.any(x.derivatives()) for x in pose)


def test_impossible_path_is_refused_with_the_parameters():
    with pytest.raises(ValidationError, match="waypoint_times_s"):
        SourceRobotParameters(
            waypoints_m=((0.0, 0.0), (1.0, 0.0)), waypoint_times_s=(0.0, 0.1)
        )
