"""The ports and helper functions that the blocks of all baselines share."""

from __future__ import annotations

from collections.abc import Sequence

from systems.base.robot import RobotParameters
from systems.framework.block import Block, Port

#: Distance from the target within which echoes count as echoes of the target, m.
SOURCE_CLEARANCE_M = 0.5


class BaselineController(Block):
    """The ports of every baseline: target and pose as inputs, a twist as output."""

    inputs: Sequence[Port] = (
        Port("p_WS_estimated", 2, "m"),
        Port("v_WS_estimated", 2, "m/s"),
        Port("target_valid", 1, "0 or 1"),
        Port("pose_WB_estimated", 3, "m, m, rad"),
    )
    outputs = (Port("twist_B", 2, "m/s, rad/s", ("wanted_speed", "wanted_turn")),)


def half_size(robot: RobotParameters) -> tuple[float, float]:
    """Returns half of the body's length and width, m."""
    return 0.5 * robot.length_m, 0.5 * robot.width_m
