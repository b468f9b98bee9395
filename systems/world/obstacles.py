"""Boxes at rest and moving boxes that the robot must not touch."""

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

        Each output port lists the values of all obstacles, one obstacle after the
        other. The outputs depend only on time. The block has no state and no latency.

        Args:
            obstacles: A sequence of ``ObstacleParameters``.
        """

        part, stage = "obstacles", "world"
        outputs = (
            Port("poses_WO", "3 obstacles", "m, m, rad each"),
            Port("velocities_WO", "3 obstacles", "m/s, m/s, rad/s each"),
            Port("sizes", "2 obstacles", "m, m each"),
        )

        def _construct(
            self,
            *,
            obstacles: Sequence[ObstacleParameters] = (),
            converter: Any = None,
        ) -> None:
            super().__init__(converter=converter)
            self.set_name("obstacles")
            self._paths = [obstacle.path() for obstacle in obstacles]
            self._sizes = [extent for o in obstacles for extent in o.size_m]
            moving = any(path.moves for path in self._paths)
            ticket = self.time_ticket() if moving else self.nothing_ticket()
            self.declare_ports(sizes={"obstacles": len(obstacles)})
            self.declare_output("poses_WO", self._poses, {ticket})
            self.declare_output("velocities_WO", self._velocities, {ticket})
            self.declare_output("sizes", self._extents, {self.nothing_ticket()})

        def _poses(self, context, output):
            time = seconds(context)
            output.SetFromVector(_flat(path.pose(time) for path in self._paths))

        def _velocities(self, context, output):
            time = seconds(context)
            output.SetFromVector(_flat(path.velocity(time) for path in self._paths))

        def _extents(self, context, output):
            output.SetFromVector(np.array(self._sizes, dtype=float))

    return Impl


Obstacles = Obstacles_[None]


def _flat(rows) -> np.ndarray:
    return np.array([value for row in rows for value in row], dtype=float)
