"""The ports of all baseline laws, and the occupied cells that some baselines avoid."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from systems.base.robot import RobotParameters
from systems.framework.block import OBJECT, Block, Port
from systems.planning.occupied import list_occupied


class BaselineController(Block):
    """Declares the ports of every baseline: target and pose in, twist out."""

    inputs: Sequence[Port] = (
        Port("p_WS_estimated", 2, "m"),
        Port("v_WS_estimated", 2, "m/s"),
        Port("target_valid", 1, "0 or 1"),
        Port("pose_WB_estimated", 3, "m, m, rad"),
    )
    outputs = (Port("twist_B", 2, "m/s, rad/s", ("wanted_speed", "wanted_turn")),)


class MapController(BaselineController):
    """Adds the map of free space to the inputs of a baseline law."""

    inputs = (*BaselineController.inputs, Port("free_space", OBJECT, "FreeSpace"))


@register_jitable
def occupied_around(inputs: Any, reach_m: float) -> NDArray[np.float64]:
    """Lists the occupied cells around the robot.

    A cell is occupied if an echo came from it and no sensor has seen it free since.
    The body of the target is an obstacle, too.

    Args:
        inputs: Values of the input ports of a ``MapController``.
        reach_m: Half of the side of the square around the robot that is searched, m.

    Returns:
        (n, 3) cells: x and y of the middle in the world frame W, m, and the certainty
        that the cell is occupied, 0 to 1.
    """
    pose = inputs[3]
    return list_occupied(inputs[4], pose[0], pose[1], reach_m, (0.0, 0.0, -1.0))


def half_size(robot: RobotParameters) -> tuple[float, float]:
    """Returns half of the body's length and width, m."""
    return 0.5 * robot.length_m, 0.5 * robot.width_m
