"""A sensor that gives exact collision vectors, without the errors of range sensors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from systems.base.robot import RobotParameters
from systems.framework.block import Block_, Port, Step
from systems.framework.finite import check_finite
from systems.framework.parameters import Positive, Size
from systems.framework.scalar_math import float_of
from systems.framework.scalar_types import define_for_scalars
from systems.framework.signals import TICK_S
from systems.ranging.collision_vector import (
    COLLISION_PORTS,
    SLOTS,
    fill_slots,
)
from systems.ranging.owners import owners_of, with_last
from systems.world.geometry import control_point, nearest_point_on_rectangle, rotate


@register_jitable
def nearest_vectors(
    pose_WB: Any,
    rectangles: Any,
    owners: Any,
    control_point_m: Any,
    maximum_range: Any,
    slots: Any,
) -> Any:
    """Computes the vectors from the control point P to the nearest bodies.

    Each vector leads to the nearest point of a body.

    Args:
        pose_WB: Pose (x, y, theta) of the robot, m and rad; floats or AutoDiffXd.
        rectangles: Rectangles (x, y, theta, length, width, radius) of the bodies in the
            world frame W, m and rad. Those of one body follow each other.
        owners: Number of the body of each rectangle.
        control_point_m: Distance of P ahead of the axle, m.
        maximum_range: Largest distance from P at which bodies are seen, m.
        slots: Largest number of vectors.

    Returns:
        Vectors (feature, x, y), nearest body first. The feature is the number of the
        body, counted from 1. x and y are in the axes of the robot, m.
    """
    p_WP = control_point(pose_WB, control_point_m)
    seen: list[Any] = []
    last = -1
    for index in range(len(rectangles)):
        dx, dy = nearest_point_on_rectangle(p_WP, rectangles[index])
        if dx * dx + dy * dy <= maximum_range * maximum_range:
            x, y = rotate(-pose_WB[2], dx, dy)
            squared = float_of(dx * dx + dy * dy)
            # Keep only the nearest rectangle of each body.
            if len(seen) > 0 and owners[index] == last:
                if squared >= seen[-1][0]:
                    continue
                seen.pop()
            last = owners[index]
            seen.append((squared, 0.0 * x + (1.0 + owners[index]), x, y))
    # The empty slice gives the empty list its type in compiled code.
    nearest = [(feature, x, y) for _, feature, x, y in seen[:0]]
    while len(nearest) < slots and len(seen) > 0:
        first = 0
        for k in range(1, len(seen)):
            if seen[k][0] < seen[first][0]:
                first = k
        _, feature, x, y = seen.pop(first)
        nearest.append((feature, x, y))
    return nearest


class ObstacleNumbers(NamedTuple):
    """Constants of ``ideal_obstacle_step``."""

    control_point_m: float
    """Distance of P ahead of the axle, m."""
    maximum_range_m: float
    """Largest distance from P at which bodies are seen, m."""
    slots: int
    """Largest number of vectors."""
    source_size: tuple[float, float]
    """Length and width of the leader, m; negative for a leader without a body."""
    owners: NDArray[np.int64]
    """(n + 1,) number of the body of each rectangle. The leader is the last body."""


def ideal_obstacle_step(
    tick: Any, state: Any, inputs: Any, outputs: Any, numbers: Any
) -> None:
    """Computes the nearest points of the bodies in one control period."""
    pose_WB, poses, sizes, pose_WS = inputs
    length, width = numbers.source_size
    bodies = [(pose_WS[0], pose_WS[1], pose_WS[2], length, width, 0.0)]
    for k in range(len(sizes) // 3):
        x, y, theta = poses[3 * k], poses[3 * k + 1], poses[3 * k + 2]
        size = sizes[3 * k], sizes[3 * k + 1], float_of(sizes[3 * k + 2])
        # The leader stays the last body.
        bodies.insert(k, (x, y, theta, size[0], size[1], size[2]))
    if length < 0.0:
        bodies.pop()
    vectors = nearest_vectors(
        pose_WB,
        bodies,
        numbers.owners,
        numbers.control_point_m,
        numbers.maximum_range_m,
        numbers.slots,
    )
    fill_slots(vectors, outputs)


@define_for_scalars("IdealObstacleSensor_", __name__)
def IdealObstacleSensor_(T):
    class Impl(Block_[T]):
        """Gives the exact nearest points of the bodies, in all directions.

        The block replaces ``UltrasonicArray`` and ``CollisionVector``, and has the same
        outputs. The output is a function of the present input. There is no state, no
        latency, and no noise. The output is differentiable wherever the nearest point
        is unique.

        Args:
            robot: Distance of the control point P ahead of the axle.
            maximum_range_m: Largest distance from P at which bodies are seen, m.
            all_bodies: Whether to report up to three bodies (``aggregation: sum``)
                instead of only the nearest body.
            source_size: Length and width of the leader, m. None: the leader has no
                body.
            obstacle_count: Number of rectangles on the ports ``poses_WO`` and
                ``sizes``.
            owners: Number of the obstacle of each rectangle, ascending from 0. None:
                each rectangle is an obstacle.
        """

        part, stage = "collision", "obstacle sensing"
        inputs = (
            Port("pose_WB", 3, "m, m, rad"),
            Port("poses_WO", "3 rectangles", "m, m, rad each"),
            Port("sizes", "3 rectangles", "m, m, m each"),
            Port("pose_WS", 3, "m, m, rad"),
        )
        outputs = COLLISION_PORTS

        def _construct(
            self,
            *,
            robot: RobotParameters = RobotParameters(),
            maximum_range_m: Positive = 3.0,
            all_bodies: bool = False,
            source_size: Size | None = (0.326, 0.352),
            obstacle_count: int = 0,
            owners: Sequence[int] | None = None,
            converter: Any = None,
        ) -> None:
            super().__init__(converter=converter)
            check_finite("IdealObstacleSensor: maximum_range_m", maximum_range_m)
            check_finite("IdealObstacleSensor: source_size", source_size or ())
            self.set_name("ideal_obstacle_sensor")
            numbers = ObstacleNumbers(
                robot.control_point_m,
                maximum_range_m,
                SLOTS if all_bodies else 1,
                source_size or (-1.0, -1.0),
                with_last(owners_of(obstacle_count, owners)),
            )
            self.declare(
                Step(ideal_obstacle_step, numbers),
                tick_s=TICK_S,
                sizes={"rectangles": obstacle_count},
            )

    return Impl


IdealObstacleSensor = IdealObstacleSensor_[None]
