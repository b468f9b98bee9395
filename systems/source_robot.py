"""The master robot that carries the loudspeaker."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Strict, model_validator
from pydrake.systems.framework import LeafSystem_

from systems.parameters import NonNegative, Parameters, Point, Positive
from systems.paths import WaypointPath, seconds
from systems.scalar_types import define_for_scalars

__all__ = ["SourceRobot", "SourceRobotParameters", "SourceRobot_"]


class SourceRobotParameters(Parameters):
    """Path and size of the master robot (Han 2019, tables 5 and 5.3)."""

    waypoints_m: Annotated[tuple[Point, ...], Strict(False)] = ((2.0, 0.0),)
    """Waypoints in W, m; one point is a source at rest."""
    speed_m_s: NonNegative = 0.3
    """Speed along the path, m/s (Han 2019, 5.3)."""
    corner_radius_m: NonNegative = 0.3
    """Largest radius of the rounded corners, m."""
    start_time_s: NonNegative = 0.0
    """The source rests at its first waypoint until then, s."""
    at_end: Literal["stop", "shuttle"] = "stop"
    """At the last waypoint: rest, or go back and forth."""
    heading_deg: float = 0.0
    """Heading of a source at rest, deg CCW from the x axis of W."""
    length_m: Positive = 0.326
    """Extent of the body along its direction of travel, m."""
    width_m: Positive = 0.352
    """Extent of the body across its direction of travel, m."""

    @model_validator(mode="after")
    def _check_path(self) -> SourceRobotParameters:
        self.path()
        return self

    def path(self) -> WaypointPath:
        """The path as a function of time."""
        return WaypointPath(
            self.waypoints_m,
            speed=self.speed_m_s,
            corner_radius=self.corner_radius_m,
            start_time=self.start_time_s,
            at_end=self.at_end,
            heading=math.radians(self.heading_deg),
        )


@define_for_scalars("SourceRobot_", __name__)
def SourceRobot_(T):
    class Impl(LeafSystem_[T]):
        """Moves the source along waypoints at constant speed.

        .. pydrake_system::

            name: SourceRobot
            output_ports:
            - pose_WS [m, m, rad]
            - v_WS [m/s, m/s, rad/s]

        A function of time alone: no state, no latency. The source is an
        exogenous body, so that gradients do not pass through it.

        Args:
            source: ``SourceRobotParameters``, or ``InterfererParameters``.
            suffix: Ends the names of block and ports; empty for the source
                that is followed.
        """

        def _construct(self, *, source=None, suffix="", converter=None):
            super().__init__(converter=converter)
            self._source = source or SourceRobotParameters()
            self._suffix = suffix
            self._path = self._source.path()
            self.set_name(f"source_robot{suffix}")
            for name, calc in (("pose_WS", self._pose), ("v_WS", self._velocity)):
                self.DeclareVectorOutputPort(
                    name=f"{name}{suffix}",
                    size=3,
                    calc=calc,
                    prerequisites_of_calc={self.time_ticket()},
                )

        def _construct_copy(self, other, converter=None):
            Impl._construct(
                self, source=other._source, suffix=other._suffix, converter=converter
            )

        def _pose(self, context, output):
            output.SetFromVector(self._path.pose(seconds(context)))

        def _velocity(self, context, output):
            output.SetFromVector(self._path.velocity(seconds(context)))

    return Impl


SourceRobot = SourceRobot_[None]
