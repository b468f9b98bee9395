"""Exact obstacle sensing in place of cones and collision vector."""

from __future__ import annotations

from typing import Any, NamedTuple

from numba.extending import register_jitable
from pydrake.systems.framework import LeafSystem_

from systems.base.robot import RobotParameters
from systems.framework.finite import check_finite
from systems.framework.parameters import Positive, Size
from systems.framework.scalar_math import float_of
from systems.framework.scalar_types import define_for_scalars
from systems.framework.signals import TICK_S
from systems.framework.step_block import Step, StepBlock
from systems.ranging.collision_vector import (
    COLLISION_FACTS,
    COLLISION_PORTS,
    SLOTS,
    fill_slots,
)
from systems.world.geometry import control_point, nearest_point_on_rectangle, rotate


@register_jitable
def nearest_vectors(
    pose_WB: Any, rectangles: Any, control_point_m: Any, maximum_range: Any, slots: Any
) -> Any:
    """Vectors from P to the nearest points of the nearest bodies.

    Args:
        pose_WB: (x, y, theta), m and rad; floats or AutoDiffXd.
        rectangles: Rectangles in W.
        control_point_m: Distance of P ahead of the axle, m.
        maximum_range: Bodies beyond it are not seen, m.
        slots: Largest number of vectors.

    Returns:
        (feature, x, y) in B axes, nearest first; the feature is the body's
        number from 1.
    """
    p_WP = control_point(pose_WB, control_point_m)
    seen = []
    for index in range(len(rectangles)):
        dx, dy = nearest_point_on_rectangle(p_WP, rectangles[index])
        if dx * dx + dy * dy <= maximum_range * maximum_range:
            x, y = rotate(-pose_WB[2], dx, dy)
            seen.append((float_of(dx * dx + dy * dy), 0.0 * x + (1.0 + index), x, y))
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
    """What the step of ``IdealObstacleSensor`` depends on."""

    control_point_m: float
    """Distance of P ahead of the axle, m."""
    maximum_range_m: float
    """Bodies beyond it are not seen, m."""
    slots: int
    """Most vectors."""
    source_size: tuple[float, float]
    """Length and width of the master robot, m."""


def ideal_obstacle_step(
    tick: Any, state: Any, inputs: Any, outputs: Any, numbers: Any
) -> None:
    """Nearest points of one tick; see ``systems.framework.step_block.Step``.

    Args:
        tick: Not used.
        state: None.
        inputs: As the input ports.
        outputs: As the output ports.
        numbers: ``ObstacleNumbers``.
    """
    pose_WB, poses, sizes, pose_WS = inputs
    length, width = numbers.source_size
    bodies = [(pose_WS[0], pose_WS[1], pose_WS[2], length, width)]
    for k in range(len(sizes) // 2):
        x, y, theta = poses[3 * k], poses[3 * k + 1], poses[3 * k + 2]
        # The master robot is the last one.
        bodies.insert(k, (x, y, theta, sizes[2 * k], sizes[2 * k + 1]))
    vectors = nearest_vectors(
        pose_WB,
        bodies,
        numbers.control_point_m,
        numbers.maximum_range_m,
        numbers.slots,
    )
    fill_slots(vectors, outputs)


@define_for_scalars("IdealObstacleSensor_", __name__)
def IdealObstacleSensor_(T):
    class Impl(LeafSystem_[T], StepBlock):
        """Gives the exact nearest points of the bodies, in all directions.

        .. pydrake_system::

            name: IdealObstacleSensor
            input_ports:
            - pose_WB [m, m, rad]
            - poses_WO [m, m, rad each]
            - sizes [m, m each]
            - pose_WS [m, m, rad]
            output_ports:
            - collision_vectors_B [m, three slots of x and y]
            - mask [0 or 1 a slot]
            - features [number of the body, 0 none]

        Stands in for ``UltrasonicArray`` and ``CollisionVector`` with the same
        outputs. A function of the present input: no state, no latency, no
        noise; differentiable wherever the nearest point is unique.

        Args:
            robot: Place of P.
            maximum_range_m: Bodies beyond it are not seen, m.
            all_bodies: Up to three bodies (``aggregation: sum``) instead of
                the nearest one.
            source_size: Length and width of the master robot, m.
            obstacle_count: Number of boxes on the obstacle ports.
        """

        FACTS = COLLISION_FACTS

        def _construct(
            self,
            *,
            robot=None,
            maximum_range_m: Positive = 3.0,
            all_bodies: bool = False,
            source_size: Size = (0.326, 0.352),
            obstacle_count: int = 0,
            converter=None,
        ):
            super().__init__(converter=converter)
            self._config = {
                "robot": robot or RobotParameters(),
                "maximum_range_m": maximum_range_m,
                "all_bodies": all_bodies,
                "source_size": source_size,
                "obstacle_count": obstacle_count,
            }
            for name in ("maximum_range_m", "source_size"):
                check_finite(f"IdealObstacleSensor: {name}", self._config[name])
            self.set_name("ideal_obstacle_sensor")
            numbers = ObstacleNumbers(
                (robot or RobotParameters()).control_point_m,
                maximum_range_m,
                SLOTS if all_bodies else 1,
                source_size,
            )
            self.declare_step(
                T,
                Step(ideal_obstacle_step, numbers),
                (
                    ("pose_WB", 3),
                    ("poses_WO", 3 * obstacle_count),
                    ("sizes", 2 * obstacle_count),
                    ("pose_WS", 3),
                ),
                COLLISION_PORTS,
                TICK_S,
            )

        def _construct_copy(self, other, converter=None):
            Impl._construct(self, **other._config, converter=converter)

    return Impl


IdealObstacleSensor = IdealObstacleSensor_[None]
