"""Memory of a long body's passage, and its motion along the axis of the passage.

A long body can pass a passage that is narrower than the disc around it only in line
with the axis. The middle of its front follows the axis, and the rear comes in line
behind it.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from systems.framework.compiling import njit
from systems.planning.turning import wrapped

# States of ``Passage``.
# ``OPEN``: there is no passage.
# ``APPROACHING``: the robot drives to the place from which it lines up.
# ``PASSING``: the front follows the axis.
# ``RETREATING``: the robot backs out, because the guard has stopped it.
# ``LEAVING``: the robot turns away from a wall behind the passage.
OPEN, APPROACHING, PASSING, RETREATING, LEAVING = range(5)

#: Distance of the front from the entrance at which it meets the axis, as a multiple of
#: half of the body's length. The heading error then decreases by this power of e.
APPROACH = 3.8
# ``_LINED_UP_RAD``: largest heading error at the entrance, rad.
# ``_LINED_UP``: largest distance from the axis there, as a multiple of the half width.
_LINED_UP_RAD, _LINED_UP = 0.015, 0.03
#: Distance within which the front returns to the axis, as a multiple of half of the
#: length.
_RETURN = 0.5
# ``lines_up`` predicts the motion in steps.
# ``_STEP_M``: length of a step, m.
# ``_MOST_STEPS``: number of steps after which the prediction ends.
# ``_MOST_ERROR_RAD``: heading error with which it cannot follow the axis, rad.
_STEP_M, _MOST_STEPS, _MOST_ERROR_RAD = 0.02, 1000, 1.2
#: Length beyond ``APPROACH`` from which the robot may line up, as a multiple of half of
#: its length.
_EARLIER = 1.5


class Passage(NamedTuple):
    """The passage for which the robot lines up. Arrays have the shape (1,)."""

    state: NDArray[np.float64]
    """One of the states from ``OPEN`` to ``LEAVING``."""
    middle: NDArray[np.float64]
    """(2,) point (x, y) on the axis, in the middle of the passage, m."""
    axis: NDArray[np.float64]
    """Direction of the axis, rad."""
    half_m: NDArray[np.float64]
    """Half of the length of the part of the route whose disc is in the passage, m."""
    width_m: NDArray[np.float64]
    """Width of the passage, m."""
    approach: NDArray[np.float64]
    """(2,) point (x, y) from which the axle starts along the axis, m."""
    backed_from: NDArray[np.float64]
    """Position of the front along the axis at which the robot began to back out, m."""
    failures: NDArray[np.float64]
    """Number of times that the guard has stopped the robot in this passage."""
    maps: NDArray[np.float64]
    """Number of maps of which the axis is the mean."""


def make_passage() -> Passage:
    """Makes the memory without a passage."""
    return Passage(*(np.zeros(n) for n in (1, 2, 1, 1, 1, 2, 1, 1, 1)))


@register_jitable
def front_error(p: Passage, pose: Any, half_length: float) -> tuple[float, float]:
    """Computes where the middle of the front is, along and beside the axis, m."""
    c, s = math.cos(p.axis[0]), math.sin(p.axis[0])
    dx = pose[0] + half_length * math.cos(pose[2]) - p.middle[0]
    dy = pose[1] + half_length * math.sin(pose[2]) - p.middle[1]
    return c * dx + s * dy, c * dy - s * dx


@register_jitable
def entrance(p: Passage, half_length: float) -> float:
    """Computes where the front enters the passage, along the axis, m.

    A disc that moves along the axis meets the passage half of the body's length
    earlier.
    """
    return half_length - p.half_m[0]


@register_jitable
def along_axis(p: Passage, pose: Any, half_length: float) -> float:
    """Computes the direction in which the front has to move, from the heading, rad."""
    _, aside = front_error(p, pose, half_length)
    wanted = p.axis[0] - math.atan(aside / (_RETURN * half_length))
    return wrapped(wanted - pose[2])


@njit(cache=True)
def lines_up(
    p: Passage, pose: Any, half_size: Any
) -> bool:  # pragma: no cover  (compiled)
    """Predicts whether the robot is in line when its front enters the passage."""
    half_length = half_size[0]
    x, y, theta = pose[0], pose[1], pose[2]
    along, aside = front_error(p, pose, half_length)
    enters = entrance(p, half_length)
    if along < enters - (APPROACH + _EARLIER) * half_length:
        return False
    for _ in range(_MOST_STEPS):
        now = x, y, theta
        along, aside = front_error(p, now, half_length)
        error = along_axis(p, now, half_length)
        if along >= enters:
            off = abs(wrapped(p.axis[0] - theta))
            return off < _LINED_UP_RAD and abs(aside) < _LINED_UP * half_size[1]
        if abs(error) > _MOST_ERROR_RAD:
            return False
        way = _STEP_M * math.cos(error)
        x, y = x + way * math.cos(theta), y + way * math.sin(theta)
        theta += _STEP_M * math.sin(error) / half_length
    return False
