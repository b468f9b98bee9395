"""Obstacles at rest and moving obstacles that the robot must not touch."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from systems.framework.block import Block_, Port
from systems.framework.scalar_types import define_for_scalars
from systems.world.parameters import ObstacleParameters
from systems.world.paths import seconds


@define_for_scalars("Obstacles_", __name__)
def Obstacles_(T):
    class Impl(Block_[T]):
        """Publishes the poses, velocities, and sizes of the obstacles.

        An obstacle consists of one or more rectangles (``systems.world.plane``). Each
        output port lists the values of all rectangles, one obstacle after the other.
        A size consists of length, width and radius. The outputs depend only on time.
        The block has no state and no latency.

        Args:
            obstacles: A sequence of ``ObstacleParameters``, or of other objects with
                the methods ``path`` and ``shape``.
        """

        part, stage = "obstacles", "world"
        outputs = (
            Port("poses_WO", "3 rectangles", "m, m, rad each"),
            Port("velocities_WO", "3 rectangles", "m/s, m/s, rad/s each"),
            Port("sizes", "3 rectangles", "m, m, m each"),
        )

        def _construct(
            self,
            *,
            obstacles: Sequence[ObstacleParameters] = (),
            converter: Any = None,
        ) -> None:
            super().__init__(converter=converter)
            self.set_name("obstacles")
            self._bodies = [(each.path(), each.shape()) for each in obstacles]
            sizes = [shape.rectangles[:, 3:] for _, shape in self._bodies]
            self._sizes = _flat(sizes)
            moving = any(path.moves for path, _ in self._bodies)
            ticket = self.time_ticket() if moving else self.nothing_ticket()
            self.declare_ports(sizes={"rectangles": len(self._sizes) // 3})
            self.declare_output("poses_WO", self._poses, {ticket})
            self.declare_output("velocities_WO", self._velocities, {ticket})
            self.declare_output("sizes", self._extents, {self.nothing_ticket()})

        def _poses(self, context, output):
            time = seconds(context)
            poses = [shape.at(path.pose(time))[:, :3] for path, shape in self._bodies]
            output.SetFromVector(_flat(poses))

        def _velocities(self, context, output):
            time = seconds(context)
            velocities = []
            for path, shape in self._bodies:
                vx, vy, omega = path.velocity(time)
                x, y, _ = pose = path.pose(time)
                rows = shape.at(pose)
                found = np.full((len(rows), 3), omega)
                found[:, 0] = vx - omega * (rows[:, 1] - y)
                found[:, 1] = vy + omega * (rows[:, 0] - x)
                velocities.append(found)
            output.SetFromVector(_flat(velocities))

        def _extents(self, context, output):
            output.SetFromVector(self._sizes)

    return Impl


Obstacles = Obstacles_[None]


def _flat(tables: Sequence[np.ndarray]) -> np.ndarray:
    """Joins tables with three numbers per rectangle, row by row."""
    return np.concatenate([np.empty(0), *(table.ravel() for table in tables)])
