"""Exact obstacle sensing in place of cones and collision vector."""

from __future__ import annotations

from pydrake.systems.framework import LeafSystem_

from systems.base.robot import RobotParameters
from systems.framework.cache import declare_cache
from systems.framework.finite import check_finite, read_lists
from systems.framework.parameters import Positive, Size
from systems.framework.scalar_math import float_of
from systems.framework.scalar_types import define_for_scalars
from systems.ranging.collision_vector import (
    COLLISION_FACTS,
    SLOTS,
    declare_collision_ports,
    fill_slots,
)
from systems.world.geometry import control_point, nearest_point_on_rectangle, rotate

__all__ = ["IdealObstacleSensor", "IdealObstacleSensor_", "nearest_vectors"]


def nearest_vectors(pose_WB, rectangles, control_point_m, maximum_range, slots):
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
    for index, rectangle in enumerate(rectangles):
        dx, dy = nearest_point_on_rectangle(p_WP, rectangle)
        squared = dx * dx + dy * dy
        if squared <= maximum_range * maximum_range:
            seen.append((squared, index, dx, dy))
    seen.sort(key=lambda item: (float_of(item[0]), item[1]))
    return [
        (1.0 + index, *rotate(-pose_WB[2], dx, dy)) for _, index, dx, dy in seen[:slots]
    ]


@define_for_scalars("IdealObstacleSensor_", __name__)
def IdealObstacleSensor_(T):
    class Impl(LeafSystem_[T]):
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
            self._inputs = [
                self.DeclareVectorInputPort(name=name, size=size)
                for name, size in (
                    ("pose_WB", 3),
                    ("poses_WO", 3 * obstacle_count),
                    ("sizes", 2 * obstacle_count),
                    ("pose_WS", 3),
                )
            ]
            sources = {port.ticket() for port in self._inputs}
            slots = declare_cache(self, "slots", self._slots, sources)
            declare_collision_ports(self, slots)

        def _construct_copy(self, other, converter=None):
            Impl._construct(self, **other._config, converter=converter)

        def _slots(self, context):
            pose_WB, poses, sizes, pose_WS = read_lists(context, self._inputs)
            bodies = [
                (*poses[3 * k : 3 * k + 3], *sizes[2 * k : 2 * k + 2])
                for k in range(self._config["obstacle_count"])
            ]
            bodies.append((*pose_WS, *self._config["source_size"]))
            vectors = nearest_vectors(
                pose_WB,
                bodies,
                self._config["robot"].control_point_m,
                self._config["maximum_range_m"],
                SLOTS if self._config["all_bodies"] else 1,
            )
            return fill_slots(vectors, T)

    return Impl


IdealObstacleSensor = IdealObstacleSensor_[None]
