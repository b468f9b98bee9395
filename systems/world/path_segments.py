"""Describes a path through waypoints by lines, arcs, and turns on the spot."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

from systems.framework.input_error import InputError

Pose = tuple[float, float, float]

#: Shortest line that a path contains, m. It suppresses lines that rounding errors leave
#: between two arcs.
_SHORTEST_M = 1e-12

#: If the direction of a path changes by half a turn up to this angle, rad, the path
#: goes back on the same line.
_BACK_RAD = 1e-6


class Segment(NamedTuple):
    """A line (curvature 0), an arc, or a turn on the spot, given by its start pose.

    ``s`` is the distance along a line or an arc, m. In a turn on the spot, ``s`` is the
    angle, rad.
    """

    x: float
    y: float
    theta: float
    forward: float
    """Distance per s: 1; 0 for a turn on the spot."""
    curvature: float
    """Change of the heading per s. It is 1 or -1 for a turn on the spot."""
    length: float
    """Value of s at the end."""

    def pose(self, s: float) -> Pose:
        """Returns the pose in W, m and rad."""
        return along(self.x, self.y, self.theta, self.forward, self.curvature, s)

    def part(self, begin: float, end: float) -> Segment:
        """Returns the part between two values of s."""
        pose = self.pose(begin)
        return Segment(*pose, self.forward, self.curvature, end - begin)


class Leg(NamedTuple):
    """The way from one waypoint to the next."""

    line: Segment
    """The line that the corners at its ends leave. Its length may be 0."""
    corner: Segment | None
    """Arc into the next leg, or turn on the spot at its end; None without a turn."""
    stops: bool
    """Whether the body comes to rest at the end of the line."""


def along(
    x: float, y: float, theta: float, forward: float, curvature: float, s: float
) -> Pose:
    """Returns the pose at ``s`` on a segment, whose start pose is x, y, theta."""
    if curvature == 0.0:
        return x + s * math.cos(theta), y + s * math.sin(theta), theta
    end = theta + curvature * s
    if forward == 0.0:
        return x, y, end
    return (
        x + (math.sin(end) - math.sin(theta)) / curvature,
        y - (math.cos(end) - math.cos(theta)) / curvature,
        end,
    )


def make_legs(
    waypoints: Sequence[tuple[float, float]],
    corner_radius: float,
    stops: Sequence[bool],
    *,
    closed: bool,
) -> list[Leg]:
    """Computes the lines between the waypoints, and the corners that join the lines.

    An arc replaces a corner, so the path passes beside the waypoint. If the body stops
    at the waypoint, or if the path goes back on the same line, the lines extend to the
    waypoint. The body then turns on the spot.

    Args:
        waypoints: Points in W, m. The last point of a closed path is the first point.
        corner_radius: Largest radius of the arcs, m. An arc replaces at most half of
            each line.
        stops: For each waypoint, whether the body stops there.
        closed: Whether the last leg leads into the first leg. The line of the first leg
            then begins at the end of the arc at the first waypoint.

    Returns:
        One leg per pair of neighbors.

    Raises:
        InputError: Two neighbors coincide.
    """
    lines = [_line(*ends) for ends in pairwise(waypoints)]
    joined = [*pairwise(lines), *([(lines[-1], lines[0])] if closed else [])]
    corners = [
        _corner(line, after, corner_radius, stops=stop)
        for (line, after), stop in zip(joined, stops[1:], strict=False)
    ]
    trimmed = corners[-1][1] if closed else 0.0
    legs = []
    for line, (corner, cut, stop) in zip(
        lines, [*corners, *[(None, 0.0, True)] * (not closed)], strict=True
    ):
        legs.append(Leg(_trimmed(line, trimmed, cut), corner, stop))
        trimmed = cut
    return legs


def approach(leg: Leg, waypoint: tuple[float, float]) -> list[Segment]:
    """Returns the line from the first waypoint of a closed path to its first leg.

    A body starts at the waypoint. In later laps, it comes to the leg by an arc. The
    list is empty if the leg begins at the waypoint.
    """
    line, (x, y) = leg.line, waypoint
    length = math.hypot(line.x - x, line.y - y)
    return [line._replace(x=x, y=y, length=length)] if length > _SHORTEST_M else []


def driven(leg: Leg) -> list[Segment]:
    """Returns the segments of a leg on which a body drives: its line and its arc."""
    line = [leg.line] if leg.line.length > _SHORTEST_M else []
    return [*line, *([leg.corner] if leg.corner and not leg.stops else [])]


def _line(first: tuple[float, float], second: tuple[float, float]) -> Segment:
    (x0, y0), (x1, y1) = first, second
    length = math.hypot(x1 - x0, y1 - y0)
    if length < 1e-9:
        raise InputError(
            "waypoints_m", f"({x0}, {y0}) is listed twice in a row; remove one of them"
        )
    return Segment(x0, y0, math.atan2(y1 - y0, x1 - x0), 1.0, 0.0, length)


def _trimmed(line: Segment, start: float, end: float) -> Segment:
    return line._replace(
        x=line.x + start * math.cos(line.theta),
        y=line.y + start * math.sin(line.theta),
        length=max(line.length - start - end, 0.0),
    )


def _corner(
    line: Segment, after: Segment, radius: float, *, stops: bool
) -> tuple[Segment | None, float, bool]:
    """Returns the corner, the length it cuts off each line, and whether it stops."""
    turn = math.remainder(after.theta - line.theta, math.tau)
    stops = stops or abs(abs(turn) - math.pi) < _BACK_RAD
    if abs(turn) < 1e-9:
        return None, 0.0, stops
    if stops:
        there = line.pose(line.length)
        return Segment(*there, 0.0, math.copysign(1.0, turn), abs(turn)), 0.0, True
    half = math.tan(abs(turn) / 2.0)
    radius = min(radius, min(line.length, after.length) / 2 / half)
    cut = radius * half
    start = line.length - cut
    arc = Segment(
        line.x + start * math.cos(line.theta),
        line.y + start * math.sin(line.theta),
        line.theta,
        1.0,
        math.copysign(1.0 / radius, turn),
        radius * abs(turn),
    )
    return arc, cut, False
