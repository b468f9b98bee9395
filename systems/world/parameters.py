"""Parameters of obstacles, and checks of the motion of bodies."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal

from pydantic import Field, Strict, model_validator

from systems.framework.input_error import InputError
from systems.framework.parameters import (
    Acceleration,
    Angle,
    Length,
    Line,
    NonNegativeSpeed,
    Parameters,
    Point,
    Size,
    Time,
    Times,
    Waypoints,
    with_preset,
)
from systems.world import shapes
from systems.world.path_motion import AtEnd
from systems.world.paths import ACCELERATION_M_S2, WaypointPath
from systems.world.shapes import Shape

#: Fields of ``ObstacleParameters`` by preset.
_PRESETS: Mapping[str, Mapping[str, Any]] = {
    # Shoulders are 0.4 to 0.5 m wide (DIN 33402-2). Adults walk at 1.3 to 1.5 m/s if
    # they choose the speed (Bohannon, Age and Aging 26, 1997, table 3).
    "person": {"radius_m": 0.25, "speed_m_s": 1.3}
}
#: Fields that define the shape. An obstacle has exactly one of them.
_SHAPES = "size_m", "radius_m", "polygon_m", "wall_m"
#: Shapes that are drawn by their points. By default, the points are in W.
_DRAWN = "polygon_m", "wall_m"

#: Default speed of obstacles and of the leader, m/s (Han 2019, 5.3).
SPEED_M_S = 0.3
#: Greatest speed that an obstacle may need to keep the times of its waypoints, m/s. It
#: is the limit of the field ``speed_m_s``.
_TOP_SPEED_M_S = 100.0


def check_stated_times(
    times: Sequence[float], speed_m_s: float, start_time_s: float
) -> None:
    """Rejects fields that the times of waypoints replace.

    Args:
        times: Field ``waypoint_times_s``, s.
        speed_m_s: Field ``speed_m_s``, m/s.
        start_time_s: Field ``start_time_s``, s.

    Raises:
        InputError: The times are given, and another field does not have its default.
    """
    if times and speed_m_s != SPEED_M_S:
        raise InputError(
            "speed_m_s",
            f"{speed_m_s:g} m/s cannot hold with waypoint_times_s, which decides the "
            "speed; remove one of the two",
        )
    if times and start_time_s:
        raise InputError(
            "start_time_s",
            f"{start_time_s:g} s cannot hold with waypoint_times_s, whose first value "
            f"is the start; write {start_time_s:g} as its first value instead",
        )


class ObstacleParameters(Parameters):
    """One obstacle that is at rest or moves along waypoints.

    One of the fields ``size_m``, ``radius_m``, ``polygon_m`` and ``wall_m`` defines its
    shape.
    """

    preset: Literal["person"] | None = None
    """Named obstacle. It gives the values of all other fields that are not set.
    ``person``: a disc with a radius of 0.25 m that walks at 1.3 m/s."""
    name: Line = Field(default="obstacle", min_length=1)
    """Name in results and pictures."""
    size_m: Size | None = (0.1, 0.05)
    """Shape: a box. Extents along the box's own x axis (its direction of travel) and y
    axis, m."""
    radius_m: Length | None = None
    """Shape: a disc. Its radius, m."""
    polygon_m: (
        Annotated[
            tuple[Point, ...], Strict(False), Field(min_length=3, max_length=1_000)
        ]
        | None
    ) = None
    """Shape: a filled polygon. Its corners, in either order, in the axes of the
    obstacle, m. Edges must not cross. Without ``waypoints_m`` and ``heading_deg``, the
    axes of the obstacle are those of W."""
    wall_m: (
        Annotated[
            tuple[Point, ...], Strict(False), Field(min_length=2, max_length=1_000)
        ]
        | None
    ) = None
    """Shape: a wall. Points of its middle line, in the axes of the obstacle, m. The
    corners and ends are round. Without ``waypoints_m`` and ``heading_deg``, the axes of
    the obstacle are those of W."""
    thickness_m: Length = 0.1
    """Thickness of the wall of ``wall_m``, m."""
    waypoints_m: Waypoints = ((2.0, 1.0),)
    """Waypoints of the obstacle's origin in W, m. The origin is the center of a box or
    a disc. With one waypoint the obstacle is at rest. With ``polygon_m`` or ``wall_m``,
    the default is (0, 0)."""
    heading_deg: Angle = 0.0
    """Heading of an obstacle at rest, deg CCW from the x axis of W."""
    speed_m_s: NonNegativeSpeed = SPEED_M_S
    """Speed along the waypoints, m/s."""
    acceleration_m_s2: Acceleration = ACCELERATION_M_S2
    """Acceleration when starting and braking, m/s^2."""
    start_time_s: Time = 0.0
    """Time until which the obstacle rests at its first waypoint, s."""
    at_end: AtEnd = "stop"
    """Behavior at the last waypoint. ``stop``: the obstacle rests there. ``shuttle``:
    the obstacle goes back and forth. ``loop``: the obstacle drives on to the first
    waypoint, and repeats this closed path for ever."""
    pauses_s: Times = ()
    """Pause at each waypoint, s, for example [0, 2.5, 0]. At a waypoint with a pause,
    the obstacle stops and turns on the spot. Empty: no pauses."""
    waypoint_times_s: Times = ()
    """Time at which the obstacle reaches each waypoint, s, for example [0, 4, 9]. The
    times replace ``speed_m_s`` and ``start_time_s``. Empty: it drives at
    ``speed_m_s``."""
    known: bool = True
    """Whether the map for planned routes contains this obstacle. The map contains only
    obstacles at rest."""
    corner_radius_m: Length = 0.05
    """Largest radius of the rounded corners of the path, m."""

    @model_validator(mode="before")
    @classmethod
    def _fill(cls, data: Any) -> Any:
        if not isinstance(data, Mapping):
            return data
        given = [field for field in _SHAPES if data.get(field) is not None]
        filled = dict(with_preset(data, _PRESETS))
        if given:
            # The shape of the preset does not count.
            filled = {k: v for k, v in filled.items() if k in data or k not in _SHAPES}
        if data.get("waypoint_times_s") and "speed_m_s" not in data:
            filled.pop("speed_m_s", None)  # the times decide the speed
        if any(filled.get(field) is not None for field in _SHAPES):
            filled.setdefault("size_m", None)
        if any(field in given for field in _DRAWN):
            filled.setdefault("waypoints_m", ((0.0, 0.0),))
        return filled

    @model_validator(mode="after")
    def _check_shape(self) -> ObstacleParameters:
        given = [field for field in _SHAPES if getattr(self, field) is not None]
        if len(given) != 1:
            which = " and ".join(given) or "no shape"
            raise InputError(
                given[-1] if given else "size_m",
                f"{self.name!r} has {which}; give exactly one of {', '.join(_SHAPES)}, "
                "and set the others to null",
            )
        for field in _DRAWN:
            self._check_points(field)
        if self.polygon_m and (crossing := shapes.crossing_edges(self.polygon_m)):
            first, second = crossing
            raise InputError(
                "polygon_m",
                f"{self.name!r}: the edges from corner {first}, "
                f"{self.polygon_m[first]}, and from corner {second}, "
                f"{self.polygon_m[second]}, touch; put the corners in the order around "
                "the outline",
            )
        return self

    def _check_points(self, field: str) -> None:
        points = getattr(self, field) or ()
        around = (*points, points[0]) if points and field == "polygon_m" else points
        if (k := shapes.repeated_point(around)) is not None:
            raise InputError(
                field,
                f"{self.name!r}: points {k - 1} and {k % len(points)} are both "
                f"{around[k]}; remove one",
            )

    @model_validator(mode="after")
    def _check_path(self) -> ObstacleParameters:
        check_stated_times(self.waypoint_times_s, self.speed_m_s, self.start_time_s)
        self.path()
        return self

    def shape(self) -> Shape:
        """Returns the region that the obstacle covers, in the axes of the obstacle."""
        if self.radius_m is not None:
            return shapes.disc(self.radius_m)
        if self.polygon_m is not None:
            return shapes.polygon(self.polygon_m)
        if self.wall_m is not None:
            return shapes.wall(self.wall_m, self.thickness_m)
        assert self.size_m is not None
        return shapes.box(self.size_m)

    def path(self) -> WaypointPath:
        """Returns the path of the center as a function of time."""
        return WaypointPath(
            self.waypoints_m,
            speed=_TOP_SPEED_M_S if self.waypoint_times_s else self.speed_m_s,
            acceleration=self.acceleration_m_s2,
            corner_radius=self.corner_radius_m,
            start_time=self.start_time_s,
            at_end=self.at_end,
            heading=math.radians(self.heading_deg),
            pauses=self.pauses_s,
            times=self.waypoint_times_s,
        )
