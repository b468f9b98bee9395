"""Static and moving boxes that the robot must not touch."""

from __future__ import annotations

import numpy as np
from pydrake.systems.framework import LeafSystem_

from systems.framework.block_facts import BlockFacts
from systems.framework.scalar_types import define_for_scalars
from systems.world.paths import seconds


@define_for_scalars("Obstacles_", __name__)
def Obstacles_(T):
    class Impl(LeafSystem_[T]):
        """Publishes where the boxes are, and how large.

        .. pydrake_system::

            name: Obstacles
            output_ports:
            - poses_WO [m, m, rad each]
            - velocities_WO [m/s, m/s, rad/s each]
            - sizes [m, m each]

        With n obstacles the ports have 3 n, 3 n and 2 n elements, obstacle
        after obstacle. A function of time alone: no state, no latency.

        Parameters: a sequence of ``ObstacleParameters``.
        """

        FACTS = BlockFacts("obstacles", "world")

        def _construct(self, *, obstacles=(), converter=None):
            super().__init__(converter=converter)
            self._obstacles = tuple(obstacles)
            self._paths = [obstacle.path() for obstacle in self._obstacles]
            self._sizes = [extent for o in self._obstacles for extent in o.size_m]
            self.set_name("obstacles")
            count = len(self._obstacles)
            moving = any(path.moves for path in self._paths)
            ticket = self.time_ticket() if moving else self.nothing_ticket()
            self._declare("poses_WO", 3 * count, self._poses, ticket)
            self._declare("velocities_WO", 3 * count, self._velocities, ticket)
            self._declare("sizes", 2 * count, self._extents, self.nothing_ticket())

        def _construct_copy(self, other, converter=None):
            Impl._construct(self, obstacles=other._obstacles, converter=converter)

        def _declare(self, name, size, calc, ticket):
            self.DeclareVectorOutputPort(
                name=name, size=size, calc=calc, prerequisites_of_calc={ticket}
            )

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
