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
            obstacles: A sequence of ``ObstacleParameters``.
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
            rectangles = [row for _, shape in self._bodies for row in shape.rectangles]
            self._sizes = [extent for row in rectangles for extent in row[3:]]
            moving = any(path.moves for path, _ in self._bodies)
            ticket = self.time_ticket() if moving else self.nothing_ticket()
            self.declare_ports(sizes={"rectangles": len(rectangles)})
            self.declare_output("poses_WO", self._poses, {ticket})
            self.declare_output("velocities_WO", self._velocities, {ticket})
            self.declare_output("sizes", self._extents, {self.nothing_ticket()})

        def _poses(self, context, output):
            time = seconds(context)
            rows: list[Any] = []
            for path, shape in self._bodies:
                pose = path.pose(time)
                rows += [pose] if shape.centered else [*shape.at(pose)[:, :3]]
            output.SetFromVector(_flat(rows))

        def _velocities(self, context, output):
            time = seconds(context)
            rows: list[Any] = []
            for path, shape in self._bodies:
                vx, vy, omega = path.velocity(time)
                x, y, _ = pose = path.pose(time)
                rows += [
                    (vx - omega * (row[1] - y), vy + omega * (row[0] - x), omega)
                    for row in shape.at(pose)
                ]
            output.SetFromVector(_flat(rows))

        def _extents(self, context, output):
            output.SetFromVector(np.array(self._sizes, dtype=float))

    return Impl


Obstacles = Obstacles_[None]


def _flat(rows) -> np.ndarray:
    return np.array([value for row in rows for value in row], dtype=float)
