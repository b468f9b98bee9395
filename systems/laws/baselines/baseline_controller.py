"""The ports of all baseline laws, and the occupied cells that some baselines avoid."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from systems.base.robot import RobotParameters
from systems.framework.block import OBJECT, Block, Port
from systems.framework.compiling import njit
from systems.planning.occupied import SOURCE_CLEARANCE_M, list_occupied


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


@njit(cache=True)
def split_at_disc(
    cells: Any, middle: Any, radius: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:  # pragma: no cover  (compiled)
    """Separates the cells outside a disc from those inside.

    Args:
        cells: (n, 3) occupied cells: x and y in the world frame W, m, and certainty.
        middle: Middle (x, y) of the disc in W, m.
        radius: Radius of the disc, m.

    Returns:
        (k, 3) cells outside the disc, and (n - k, 3) cells inside.
    """
    found, beyond, within = np.empty(cells.shape), 0, len(cells)
    for n in range(len(cells)):
        if math.hypot(cells[n, 0] - middle[0], cells[n, 1] - middle[1]) < radius:
            within -= 1
            found[within] = cells[n]
        else:
            found[beyond] = cells[n]
            beyond += 1
    return found[:beyond], found[within:]


@register_jitable
def occupied_around(inputs: Any, reach_m: float) -> Any:
    """Lists the occupied cells around the robot.

    A cell is occupied if an echo came from it and no sensor has seen it free since.

    Args:
        inputs: Values of the input ports of a ``MapController``.
        reach_m: Half of the side of the square around the robot that is searched, m.

    Returns:
        Cells of obstacles, and cells within 0.5 m of the target, which may be echoes of
        the target; each as from ``list_occupied``.
    """
    target, valid, pose, space = inputs[0], inputs[2][0], inputs[3], inputs[4]
    cells = list_occupied(space, pose[0], pose[1], reach_m)
    radius = SOURCE_CLEARANCE_M if valid > 0.5 else -1.0
    return split_at_disc(cells, (target[0], target[1]), radius)


def half_size(robot: RobotParameters) -> tuple[float, float]:
    """Returns half of the body's length and width, m."""
    return 0.5 * robot.length_m, 0.5 * robot.width_m
