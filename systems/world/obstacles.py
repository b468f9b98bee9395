"""Static and moving boxes that the robot must not touch."""

from __future__ import annotations

import math

import numpy as np
from pydantic import Field, model_validator
from pydrake.systems.framework import LeafSystem_

from systems.framework.block_facts import BlockFacts
from systems.framework.parameters import (
    Acceleration,
    Angle,
    Length,
    NonNegativeSpeed,
    Parameters,
    Size,
    Time,
    Waypoints,
)
from systems.framework.scalar_types import define_for_scalars
from systems.world.paths import ACCELERATION_M_S2, AtEnd, WaypointPath, seconds

__all__ = ["ObstacleParameters", "Obstacles", "Obstacles_"]


class ObstacleParameters(Parameters):
    """One box, at rest or moving along waypoints."""

    name: str = Field(default="obstacle", min_length=1)
    """Name in results and pictures."""
    size_m: Size = (0.1, 0.05)
    """Extents along its own x axis (its direction of travel) and y axis, m."""
    waypoints_m: Waypoints = ((2.0, 1.0),)
    """Waypoints of its centre in W, m; one point is an obstacle at rest."""
    heading_deg: Angle = 0.0
    """Heading of an obstacle at rest, deg CCW from the x axis of W."""
    speed_m_s: NonNegativeSpeed = 0.3
    """Speed along the waypoints, m/s."""
    acceleration_m_s2: Acceleration = ACCELERATION_M_S2
    """Of that speed where it starts and brakes, m/s^2."""
    start_time_s: Time = 0.0
    """It rests at its first waypoint until then, s."""
    at_end: AtEnd = "stop"
    """At the last waypoint: rest, or go back and forth."""
    known: bool = True
    """Whether the map has it that robots plan their ways on; only what rests counts."""
    corner_radius_m: Length = 0.05
    """Largest radius of the rounded corners, m."""

    @model_validator(mode="after")
    def _check_path(self) -> ObstacleParameters:
        self.path()
        return self

    def path(self) -> WaypointPath:
        """The path of the centre as a function of time."""
        return WaypointPath(
            self.waypoints_m,
            speed=self.speed_m_s,
            acceleration=self.acceleration_m_s2,
            corner_radius=self.corner_radius_m,
            start_time=self.start_time_s,
            at_end=self.at_end,
            heading=math.radians(self.heading_deg),
        )


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
