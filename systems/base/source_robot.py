"""The master robot that carries the loudspeaker."""

from __future__ import annotations

from pydrake.systems.framework import LeafSystem_

from systems.base.carrier_parameters import SourceRobotParameters
from systems.framework.block_facts import BlockFacts
from systems.framework.scalar_types import define_for_scalars
from systems.world.paths import seconds


@define_for_scalars("SourceRobot_", __name__)
def SourceRobot_(T):
    class Impl(LeafSystem_[T]):
        """Drives the source along its waypoints.

        .. pydrake_system::

            name: SourceRobot
            output_ports:
            - pose_WS [m, m, rad]
            - v_WS [m/s, m/s, rad/s]

        The motion is that of its wheels (``DrivenPath``), on which nothing acts
        back: a function of time alone, no state, no latency. The source is an
        exogenous body, so that gradients do not pass through it.

        Args:
            source: ``SourceRobotParameters``.
        """

        FACTS = BlockFacts("source", "world")

        def _construct(self, *, source=None, converter=None):
            super().__init__(converter=converter)
            self._source = source or SourceRobotParameters()
            self._path = self._source.path()
            self.set_name("source_robot")
            for name, calc in (("pose_WS", self._pose), ("v_WS", self._velocity)):
                self.DeclareVectorOutputPort(
                    name=name,
                    size=3,
                    calc=calc,
                    prerequisites_of_calc={self.time_ticket()},
                )

        def _construct_copy(self, other, converter=None):
            Impl._construct(self, source=other._source, converter=converter)

        def _pose(self, context, output):
            output.SetFromVector(self._path.pose(seconds(context)))

        def _velocity(self, context, output):
            output.SetFromVector(self._path.velocity(seconds(context)))

    return Impl


SourceRobot = SourceRobot_[None]
