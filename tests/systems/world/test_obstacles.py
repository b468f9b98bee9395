"""Boxes: two of them, moving and at rest, in the ports' order."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pydantic import ValidationError

from phonotaxis.testing import Bench, evaluate
from systems.world.obstacles import Obstacles
from systems.world.parameters import ObstacleParameters

pytestmark = pytest.mark.drake

RESTING = ObstacleParameters(
    name="box", waypoints_m=((3.0, -1.0),), heading_deg=30.0, size_m=(0.4, 0.1)
)
MOVING = ObstacleParameters(
    name="cart",
    waypoints_m=((0.0, 4.0), (0.0, 0.0)),
    speed_m_s=0.5,
    acceleration_m_s2=2.0,
    size_m=(0.2, 0.3),
)
#: What a ramp costs, v^2 / 2a.
RAMP_M = 0.0625


def test_ports_hold_obstacle_after_obstacle():
    outputs = evaluate(Obstacles(obstacles=(RESTING, MOVING)), time_s=2.0)
    poses = [3.0, -1.0, math.pi / 6, 0.0, 3.0 + RAMP_M, -math.pi / 2]
    np.testing.assert_allclose(outputs["poses_WO"], poses, atol=1e-15)
    velocities = [0.0, 0.0, 0.0, 0.0, -0.5, 0.0]
    np.testing.assert_allclose(outputs["velocities_WO"], velocities, atol=1e-15)
    np.testing.assert_array_equal(outputs["sizes"], [0.4, 0.1, 0.0, 0.2, 0.3, 0.0])


def test_moving_boxes_follow_time_in_one_context():
    at = Bench(Obstacles(obstacles=(MOVING,)), time_s=2.0)
    at.output("poses_WO")
    at.context.SetTime(4.0)
    assert at.output("poses_WO")[1] == pytest.approx(2.0 + RAMP_M)


def test_shuttling_box_returns():
    shuttle = MOVING.model_copy(update={"at_end": "shuttle"})
    outputs = evaluate(
        Obstacles(obstacles=(shuttle,)), time_s=10.25
    )  # 8.25 s, 2 s back
    np.testing.assert_allclose(
        outputs["poses_WO"], [0.0, 1.0 - RAMP_M, -math.pi / 2], atol=1e-12
    )
    assert outputs["velocities_WO"][1] == pytest.approx(0.5)


def test_a_box_without_a_name_is_refused():
    with pytest.raises(ValidationError, match="name"):
        ObstacleParameters(name="")


def test_no_obstacles_no_elements():
    block = Obstacles()
    ports = [block.get_output_port(k) for k in range(3)]
    assert [port.size() for port in ports] == [0, 0, 0]


def test_converted_block_has_the_same_boxes():
    block = Obstacles(obstacles=(RESTING, MOVING))
    floats, duals = Bench(block, time_s=2.0), Bench(block.ToAutoDiffXd(), time_s=2.0)
    for name in ("poses_WO", "velocities_WO", "sizes"):
        values = [x.value() for x in duals.output(name)]
        np.testing.assert_array_equal(values, floats.output(name))


@pytest.mark.parametrize("size", [(0.0, 0.1), (0.1, -0.1)])
def test_a_box_has_two_extents(size):
    with pytest.raises(ValidationError, match="greater than"):
        ObstacleParameters(size_m=size)
