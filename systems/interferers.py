"""Sounds that nobody is to follow."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, Strict, model_validator

from systems.parameters import NonNegative, Parameters, Point
from systems.paths import WaypointPath
from systems.waveforms import SoundParameters

__all__ = ["InterfererParameters"]


class InterfererParameters(Parameters):
    """A loudspeaker without a body, at rest or moving along waypoints."""

    name: str = Field(default="interferer", pattern=r"\A[a-z][a-z0-9_]*\z")
    """Name of its own, of small letters, digits and underscores."""
    waypoints_m: Annotated[tuple[Point, ...], Strict(False)] = ((0.0, 2.0),)
    """Waypoints in W, m; one point is an interferer at rest."""
    speed_m_s: NonNegative = 0.3
    """Speed along the waypoints, m/s."""
    start_time_s: NonNegative = 0.0
    """It rests at its first waypoint until then, s."""
    at_end: Literal["stop", "shuttle"] = "stop"
    """At the last waypoint: rest, or go back and forth."""
    corner_radius_m: NonNegative = 0.3
    """Largest radius of the rounded corners, m."""
    sound: SoundParameters = SoundParameters()
    """What it plays."""

    @model_validator(mode="after")
    def _check_path(self) -> InterfererParameters:
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
        )
