"""The leader, which carries the loudspeaker."""

from __future__ import annotations

from typing import Any

from systems.base.carrier_parameters import SourceRobotParameters
from systems.framework.block import Block_, Port
from systems.framework.scalar_types import define_for_scalars
from systems.world.paths import seconds


@define_for_scalars("SourceRobot_", __name__)
def SourceRobot_(T):
    class Impl(Block_[T]):
        """Drives the leader robot, which carries the sound source, along its waypoints.

        The motion is that of a robot with wheels (``DrivenPath``). No other body acts
        on the leader. The outputs depend only on time. The block has no input, no state
        and no latency, so no gradient passes through it.

        Args:
            source: Path and size of the leader.
        """

        part, stage = "source", "world"
        outputs = (Port("pose_WS", 3, "m, m, rad"), Port("v_WS", 3, "m/s, m/s, rad/s"))

        def _construct(
            self,
            *,
            source: SourceRobotParameters = SourceRobotParameters(),
            converter: Any = None,
        ) -> None:
            super().__init__(converter=converter)
            self.set_name("source_robot")
            self._path = source.path()
            self.declare_ports()
            self.declare_output("pose_WS", self._pose, {self.time_ticket()})
            self.declare_output("v_WS", self._velocity, {self.time_ticket()})

        def _pose(self, context, output):
            output.SetFromVector(self._path.pose(seconds(context)))

        def _velocity(self, context, output):
            output.SetFromVector(self._path.velocity(seconds(context)))

    return Impl


SourceRobot = SourceRobot_[None]
