"""Path of a body that drives through waypoints at constant speed.

Corners are rounded by circular arcs, so that position and velocity are
continuous and the speed along the path is exact.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["WaypointPath", "seconds"]

AtEnd = Literal["stop", "shuttle"]


@dataclass(frozen=True)
class _Segment:
    """A line (curvature 0) or an arc, by its start pose and length."""

    x: float
    y: float
    theta: float
    curvature: float
    length: float

    def pose(self, s: float) -> tuple[float, float, float]:
        if self.curvature == 0.0:
            return (
                self.x + s * math.cos(self.theta),
                self.y + s * math.sin(self.theta),
                self.theta,
            )
        theta = self.theta + self.curvature * s
        return (
            self.x + (math.sin(theta) - math.sin(self.theta)) / self.curvature,
            self.y - (math.cos(theta) - math.cos(self.theta)) / self.curvature,
            theta,
        )


class WaypointPath:
    """Pose and velocity on a path through waypoints.

    Args:
        waypoints: Points in W, m; one point is a body at rest.
        speed: Speed along the path, m/s, >= 0.
        corner_radius: Largest radius of the rounded corners, m; a corner
            takes at most half of each leg beside it.
        start_time: The body rests at the first waypoint until then, s.
        at_end: ``stop`` rests at the last waypoint, ``shuttle`` goes back
            and forth without turning round.
        heading: Heading where there is one waypoint, rad; else the path's
            tangent.

    Raises:
        ValueError: There is no waypoint, two neighbours coincide, or the
            path doubles back on itself.
    """

    def __init__(
        self,
        waypoints: Sequence[tuple[float, float]],
        *,
        speed: float,
        corner_radius: float = 0.3,
        start_time: float = 0.0,
        at_end: AtEnd = "stop",
        heading: float = 0.0,
    ) -> None:
        if not waypoints:
            raise ValueError("waypoints_m: none given; give at least one point")
        self._speed = speed
        self._start_time = start_time
        self._at_end = at_end
        self._rest = (*waypoints[0], heading)
        self._segments = _segments(waypoints, corner_radius)
        ends: list[float] = []
        for segment in self._segments:
            ends.append(segment.length + (ends[-1] if ends else 0.0))
        self._ends = ends

    @property
    def length(self) -> float:
        """Length of the path with its rounded corners, m."""
        return self._ends[-1] if self._ends else 0.0

    @property
    def moves(self) -> bool:
        """Whether the body ever leaves its first waypoint."""
        return bool(self._segments) and self._speed > 0.0

    def _arc_length(self, time: float) -> tuple[float, float]:
        """Distance along the path, m, and its rate, m/s."""
        s = self._speed * (time - self._start_time)
        if s < 0.0:
            return 0.0, 0.0
        if self._at_end == "stop":
            return (s, self._speed) if s < self.length else (self.length, 0.0)
        turns, s = divmod(s, self.length)
        if turns % 2:
            return self.length - s, -self._speed
        return s, self._speed

    def _find(self, s: float) -> tuple[_Segment, float]:
        index = min(bisect_right(self._ends, s), len(self._ends) - 1)
        start = self._ends[index - 1] if index else 0.0
        return self._segments[index], s - start

    def pose(self, time: float) -> tuple[float, float, float]:
        """(x, y, theta) in W at a time in s; m and rad."""
        if not self._segments:
            return self._rest
        s, _ = self._arc_length(time)
        segment, along = self._find(s)
        return segment.pose(along)

    def poses(self, times: ArrayLike) -> NDArray[np.float64]:
        """(n, 3) poses at many times at once, as ``pose`` gives them one by one."""
        times = np.asarray(times, dtype=float)
        if not self.moves:
            return np.tile(np.array(self.pose(0.0)), (len(times), 1))
        s = np.maximum(self._speed * (times - self._start_time), 0.0)
        if self._at_end == "stop":
            s = np.minimum(s, self.length)
        else:
            s = self.length - np.abs(s % (2.0 * self.length) - self.length)
        ends = np.array(self._ends)
        index = np.minimum(np.searchsorted(ends, s, side="right"), len(ends) - 1)
        x, y, theta, curvature, length = np.array(
            [(g.x, g.y, g.theta, g.curvature, g.length) for g in self._segments]
        )[index].T
        along = s - (ends[index] - length)
        # Chord of the arc: its length tends to ``along`` as the curvature vanishes.
        half = 0.5 * curvature * along
        chord = along * np.sinc(half / np.pi)
        return np.stack(
            [
                x + chord * np.cos(theta + half),
                y + chord * np.sin(theta + half),
                theta + 2.0 * half,
            ],
            axis=1,
        )

    def velocity(self, time: float) -> tuple[float, float, float]:
        """(vx, vy, omega) in W at a time in s; m/s and rad/s."""
        if not self.moves:
            return (0.0, 0.0, 0.0)
        s, rate = self._arc_length(time)
        segment, along = self._find(s)
        theta = segment.pose(along)[2]
        return (
            rate * math.cos(theta),
            rate * math.sin(theta),
            rate * segment.curvature,
        )


def _segments(
    waypoints: Sequence[tuple[float, float]], corner_radius: float
) -> list[_Segment]:
    """Lines between the waypoints, joined by arcs."""
    legs = []
    for (x0, y0), (x1, y1) in pairwise(waypoints):
        length = math.hypot(x1 - x0, y1 - y0)
        if length < 1e-9:
            raise ValueError(
                f"waypoints_m: ({x0}, {y0}) stands twice in a row; remove one"
            )
        legs.append((x0, y0, math.atan2(y1 - y0, x1 - x0), length))

    segments: list[_Segment] = []
    trimmed = 0.0
    for index, (x, y, theta, length) in enumerate(legs):
        arc = None
        cut = 0.0
        if index + 1 < len(legs):
            _, _, next_theta, next_length = legs[index + 1]
            turn = math.remainder(next_theta - theta, math.tau)
            if abs(abs(turn) - math.pi) < 1e-6:
                raise ValueError(
                    f"waypoints_m: the path doubles back at waypoint {index + 1}; "
                    "move a waypoint aside, or use at_end: shuttle"
                )
            arc, cut = _corner(turn, corner_radius, min(length, next_length) / 2)
        line = length - trimmed - cut
        if line > 1e-12:
            segments.append(
                _Segment(
                    x + trimmed * math.cos(theta),
                    y + trimmed * math.sin(theta),
                    theta,
                    0.0,
                    line,
                )
            )
        if arc is not None:
            curvature, arc_length = arc
            start = length - cut
            segments.append(
                _Segment(
                    x + start * math.cos(theta),
                    y + start * math.sin(theta),
                    theta,
                    curvature,
                    arc_length,
                )
            )
        trimmed = cut
    return segments


def _corner(
    turn: float, radius: float, room: float
) -> tuple[tuple[float, float] | None, float]:
    """((curvature, arc length), length cut off each leg) of a corner."""
    if abs(turn) < 1e-9 or radius == 0.0:
        return None, 0.0
    half = math.tan(abs(turn) / 2.0)
    radius = min(radius, room / half)
    arc = (math.copysign(1.0 / radius, turn), radius * abs(turn))
    return arc, radius * half


def seconds(context) -> float:
    """Time of a context as a float, whatever the context's scalar type."""
    time = context.get_time()
    return time if isinstance(time, float) else time.value()
