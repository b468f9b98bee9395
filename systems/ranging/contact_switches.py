"""Micro switches behind the front bumper of the robot."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from systems.base.robot import RobotParameters
from systems.framework.block import Block, Port, Step
from systems.framework.compiling import njit
from systems.framework.faults import STUCK_CLOSED, STUCK_OPEN, Fault, fault_ticks
from systems.framework.signals import TICK_S
from systems.ranging.owners import owners_of, with_last
from systems.world.geometry import beyond_rectangle

#: Distance between a body and the front edge up to which a switch closes, m.
REACH_M = 0.01
#: Number of test points on each half of the front edge, in addition to its middle.
_POINTS = 8
#: A touch near the middle of the front edge closes both switches. The largest distance
#: from the middle is this share of the width of the robot.
_MIDDLE = 0.1


class SwitchNumbers(NamedTuple):
    """Constants of ``contact_switches_step``."""

    points: NDArray[np.float64]
    """(n, 2) test points of the front edge in B, m, from left to right."""
    middle_m: float
    """A touch within this distance of the longitudinal axis closes both switches, m."""
    length_m: float
    """Length of the body at ``pose_WS``, m."""
    width_m: float
    """Width of the body at ``pose_WS``, m."""
    owners: NDArray[np.int64]
    """(n + 1,) number of the body of each rectangle. The body at ``pose_WS`` is the
    last one."""
    faults: NDArray[np.int64]
    """(2, 2) faults of the left and the right switch, from ``fault_ticks``."""


@njit(cache=True)
def _feel(
    pose: Any, body: Any, points: Any, middle: float
) -> tuple[bool, bool]:  # pragma: no cover  (compiled)
    """Returns whether a body closes the left switch, and whether it closes the right.

    ``body`` is a rectangle (x, y, theta, length, width, radius) in W, m and rad.
    ``points`` are the test points of the front edge in B, m. A touch closes both
    switches if its distance from the robot's x axis is at most ``middle``, m.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    # Skip a body whose circumscribed circle no switch can reach. The first test point,
    # a corner of the robot, is as far from the origin of B as any test point.
    far = 0.5 * math.hypot(body[3], body[4]) + body[5] + REACH_M
    far += math.hypot(points[0, 0], points[0, 1])
    if math.hypot(body[0] - pose[0], body[1] - pose[1]) > far:
        return False, False
    left, right = False, False
    for k in range(len(points)):
        x, y = points[k, 0], points[k, 1]
        place = pose[0] + c * x - s * y, pose[1] + s * x + c * y
        box = body[0], body[1], body[2], body[3], body[4], body[5]
        off = beyond_rectangle(place, box)
        if math.hypot(off[0], off[1]) <= REACH_M:
            left = left or y >= -middle
            right = right or y <= middle
    return left, right


def contact_switches_step(
    tick: int, state: Any, inputs: Any, outputs: Any, numbers: SwitchNumbers
) -> None:
    """Determines which switches are closed and which body the robot touches.

    If the robot touches several bodies, the step reports the one with the highest
    number.
    """
    pose, poses, sizes, followed = inputs
    rectangles = len(poses) // 3
    touched, left, right = -1, False, False
    body = np.empty(6)
    # The body at pose_WS is the last one.
    for number in range(rectangles + 1):
        if number < rectangles:
            for k in range(3):
                body[k] = poses[3 * number + k]
                body[3 + k] = sizes[3 * number + k]
        else:
            for k in range(3):
                body[k] = followed[k]
            body[3], body[4], body[5] = numbers.length_m, numbers.width_m, 0.0
        felt = _feel(pose, body, numbers.points, numbers.middle_m)
        if felt[0] or felt[1]:
            touched = numbers.owners[number]
        left, right = left or felt[0], right or felt[1]
    contact = outputs[0]
    contact[0], contact[1] = 1.0 if left else 0.0, 1.0 if right else 0.0
    # A fault changes the reading of a switch, but not the number of the touched body.
    for k in range(2):
        kind, begin = numbers.faults[k]
        if kind == STUCK_OPEN and tick >= begin:
            contact[k] = 0.0
        elif kind == STUCK_CLOSED and tick >= begin:
            contact[k] = 1.0
    outputs[1][0] = float(touched)


class ContactSwitches(Block):
    """Detects bodies that touch the front of the robot.

    There are two switches, one for each half of the front edge. A switch closes when a
    body is within ``REACH_M`` of its half. Near the middle of the edge, both switches
    close. The flanks and the rear of the robot have no switches. The switches cannot
    distinguish a source from a wall.

    The port ``touched`` has the true number of the touched body, counted from 0. The
    body at ``pose_WS`` has the last number.

    The block has no state and no latency. It computes its outputs in every control
    period.

    Args:
        faults: Faults of the robot. Only faults of ``contact_switches`` have an effect.
        robot: Size of the robot.
        bodies: Number of rectangles on the ports ``poses_WO`` and ``sizes``.
        owners: Number of the body of each rectangle, ascending from 0. None: each
            rectangle is a body.
        source_size: Length and width of the body at ``pose_WS``, m.
        tick_s: Control period, s.

    Reference: Song 2011, 2.1, 4.2.
    """

    part, stage = "contact", "obstacle sensing"
    inputs = (
        Port("pose_WB", 3, "m, m, rad"),
        Port("poses_WO", "3 rectangles", "m, m, rad each"),
        Port("sizes", "3 rectangles", "m, m, m each"),
        Port("pose_WS", 3, "m, m, rad"),
    )
    outputs = (
        Port("contact", 2, "0 or 1, left and right", ("contact_left", "contact_right")),
        Port("touched", 1, "number of a body, -1 none", "touched"),
    )

    def __init__(
        self,
        *,
        faults: Sequence[Fault] = (),
        robot: RobotParameters = RobotParameters(),
        bodies: int = 0,
        owners: Sequence[int] | None = None,
        source_size: tuple[float, float] = (0.08, 0.08),
        tick_s: float = TICK_S,
    ) -> None:
        super().__init__()
        self.set_name("contact_switches")
        y = 0.5 * robot.width_m * np.arange(_POINTS, -_POINTS - 1, -1) / _POINTS
        front = np.column_stack([np.full_like(y, 0.5 * robot.length_m), y])
        numbers = SwitchNumbers(
            front,
            _MIDDLE * robot.width_m,
            *source_size,
            with_last(owners_of(bodies, owners)),
            fault_ticks(faults, "contact_switches", 2, tick_s),
        )
        self.declare(
            Step(contact_switches_step, numbers),
            tick_s=tick_s,
            sizes={"rectangles": bodies},
            arrays=True,
        )
