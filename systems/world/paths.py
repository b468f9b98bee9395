"""Describes the path of a body that moves through waypoints.

Circular arcs replace the corners between the waypoints. The speed rises and falls with
a limited acceleration. Position and velocity are continuous, and explicit formulas give
them at any time.

The yaw rate jumps at the ends of an arc. The yaw rate of a robot with wheels cannot
jump, so ``systems/base/carrier.py`` computes the motion of such a robot.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from systems.framework.input_error import InputError

AtEnd = Literal["stop", "shuttle"]

#: Default acceleration of obstacles and of the leader, m/s^2 (not printed, our choice).
#: It is a tenth of the acceleration at which wheels slip on a floor. A body that starts
#: with this acceleration reaches 0.3 m/s after 45 mm. At that moment, it is 0.15 s
#: behind a body that started with 0.3 m/s.
ACCELERATION_M_S2 = 1.0

#: Speed below which a body is at rest, m/s.
_SLOWEST_M_S = 1e-9


class _Segment(NamedTuple):
    """A line (curvature 0) or an arc, given by its start pose and length."""

    x: float
    y: float
    theta: float
    curvature: float
    length: float

    def pose(self, s: float) -> tuple[float, float, float]:
        return _along(self.x, self.y, self.theta, self.curvature, s)


class _Piece(NamedTuple):
    """A part of a segment with constant acceleration, given by its start."""

    begin: float
    x: float
    y: float
    theta: float
    curvature: float
    speed: float
    acceleration: float


class WaypointPath:
    """Pose and velocity of a body on a path through waypoints, as functions of time.

    The motion starts and ends at rest. The speed along the path rises with the given
    acceleration, stays constant, and falls with the same acceleration. On a short path,
    the phase of constant speed is missing.

    Args:
        waypoints: Points in the world frame W, m. With one point, the body is at rest.
        speed: Speed along the path, m/s, >= 0.
        acceleration: Acceleration along the path, m/s^2, > 0.
        corner_radius: Largest radius of the rounded corners, m, > 0. Two lines meet at
            a corner, and the arc replaces at most half of each line.
        start_time: Time until which the body rests at the first waypoint, s.
        at_end: ``stop``: the body rests at the last waypoint. ``shuttle``: the body
            goes back and forth between both ends. It stops for an instant at each end
            and returns backward, without turning around.
        heading: Heading of a body with one waypoint, rad. With several waypoints, the
            heading is the tangent of the path.
        top_yaw_rate: Largest yaw rate in corners, rad/s, > 0. It limits the speed on
            arcs.

    Raises:
        InputError: There is no waypoint, two neighbors coincide, the path doubles back
            on itself, or the corner radius is not above 0.
    """

    def __init__(
        self,
        waypoints: Sequence[tuple[float, float]],
        *,
        speed: float,
        acceleration: float = ACCELERATION_M_S2,
        corner_radius: float = 0.3,
        start_time: float = 0.0,
        at_end: AtEnd = "stop",
        heading: float = 0.0,
        top_yaw_rate: float = math.inf,
    ) -> None:
        if not waypoints:
            raise InputError("waypoints_m", "no point is given; give at least one")
        if not corner_radius > 0.0:
            raise InputError(
                "corner_radius_m",
                f"at {corner_radius} m the velocity would jump at each waypoint; give "
                "a radius above 0",
            )
        segments = _segments(waypoints, corner_radius)
        self._length = math.fsum(segment.length for segment in segments)
        self._moves = bool(segments) and speed > _SLOWEST_M_S
        self._start_time = start_time
        self._shuttles = self._moves and at_end == "shuttle"
        limits = [
            min(speed, top_yaw_rate / abs(segment.curvature))
            if segment.curvature
            else speed
            for segment in segments
        ]
        pieces, self._duration = (
            _pieces(segments, limits, acceleration) if self._moves else ([], 0.0)
        )
        first = segments[0].pose(0.0) if segments else (*waypoints[0], heading)
        end = segments[-1].pose(segments[-1].length) if self._moves else first
        self._pieces = [*pieces, _Piece(self._duration, *end, 0.0, 0.0, 0.0)]
        self._begins = [piece.begin for piece in self._pieces]

    @property
    def length(self) -> float:
        """Length of the path with its rounded corners, m."""
        return self._length

    @property
    def duration(self) -> float:
        """Time from the first waypoint to the last, s; 0 for a body at rest."""
        return self._duration

    @property
    def moves(self) -> bool:
        """Whether the body ever leaves its first waypoint."""
        return self._moves

    def _find(self, time: float) -> tuple[_Piece, float, float]:
        """Returns the piece, the distance from its start, m, and the speed, m/s."""
        elapsed, direction = max(time - self._start_time, 0.0), 1.0
        if self._shuttles:
            laps, elapsed = divmod(elapsed, self._duration)
            if laps % 2:
                elapsed, direction = self._duration - elapsed, -1.0
        piece = self._pieces[bisect_right(self._begins, elapsed) - 1]
        since = elapsed - piece.begin
        distance = (piece.speed + 0.5 * piece.acceleration * since) * since
        return piece, distance, direction * (piece.speed + piece.acceleration * since)

    def pose(self, time: float) -> tuple[float, float, float]:
        """Returns (x, y, theta) in W, m and rad, at a time in s."""
        piece, s, _ = self._find(time)
        return _along(piece.x, piece.y, piece.theta, piece.curvature, s)

    def velocity(self, time: float) -> tuple[float, float, float]:
        """Returns (vx, vy, omega) in W, m/s and rad/s, at a time in s."""
        piece, s, rate = self._find(time)
        theta = piece.theta + piece.curvature * s
        return (
            rate * math.cos(theta),
            rate * math.sin(theta),
            rate * piece.curvature,
        )

    def poses(self, times: ArrayLike) -> NDArray[np.float64]:
        """Returns the (n, 3) poses in W, m and rad, at n times in s; see ``pose``."""
        times = np.asarray(times, dtype=float)
        if not self._moves:
            return np.full((len(times), 3), self._pieces[0][1:4])
        from systems.world.path_poses import poses_on  # compiled code: when it is used

        return poses_on(np.array(self._pieces), self._elapsed(times)[0])

    def twists(self, times: ArrayLike) -> NDArray[np.float64]:
        """Returns an (n, 2) array: forward speed and yaw rate at each of n times.

        The times are in s, the speeds in m/s, and the yaw rates in rad/s. On its way
        back, a shuttle drives backward, so its speed is negative.
        """
        elapsed, direction = self._elapsed(np.asarray(times, dtype=float))
        index = np.searchsorted(self._begins, elapsed, side="right") - 1
        begin, *_, curvature, speed, acceleration = np.array(self._pieces)[index].T
        rate = direction * (speed + acceleration * (elapsed - begin))
        return np.stack([rate, rate * curvature], axis=1)

    def extreme_twists(self, until: float) -> NDArray[np.float64]:
        """Returns the speeds and yaw rates at both ends of each piece of the path.

        Within a piece, the curvature is constant and the speed is linear in time.
        Therefore every point of the body is fastest at one end of the piece.

        Args:
            until: Time, s. Pieces that begin later are omitted.

        Returns:
            (n, 2) array. The columns are the forward speed, m/s, and the yaw rate,
            rad/s.
        """
        rows, last = [], until - self._start_time
        for piece, end in zip(self._pieces, self._begins[1:], strict=False):
            if piece.begin > last:
                break
            for elapsed in (piece.begin, min(end, last)):
                rate = piece.speed + piece.acceleration * (elapsed - piece.begin)
                rows.append((rate, rate * piece.curvature))
        return np.reshape(rows, (-1, 2))

    def _elapsed(self, times: NDArray[np.float64]) -> tuple[Any, Any]:
        """Returns the times in s on the forward motion, and the direction, 1 or -1."""
        elapsed = np.maximum(times - self._start_time, 0.0)
        if not self._shuttles:
            return elapsed, 1.0
        laps, elapsed = np.divmod(elapsed, self._duration)
        back = laps % 2 == 1
        return (
            np.where(back, self._duration - elapsed, elapsed),
            np.where(back, -1.0, 1.0),
        )


def _along(
    x: float, y: float, theta: float, curvature: float, s: float
) -> tuple[float, float, float]:
    """Returns the pose at the distance s along a line or an arc."""
    if curvature == 0.0:
        return x + s * math.cos(theta), y + s * math.sin(theta), theta
    end = theta + curvature * s
    return (
        x + (math.sin(end) - math.sin(theta)) / curvature,
        y - (math.cos(end) - math.cos(theta)) / curvature,
        end,
    )


def _pieces(
    segments: Sequence[_Segment], limits: Sequence[float], acceleration: float
) -> tuple[list[_Piece], float]:
    """Returns the pieces of the fastest motion along segments, and its duration in s.

    The motion starts and ends at rest. The function works with squared speeds, which
    are linear in the distance. A forward pass over the ends of the segments limits each
    squared speed to what the acceleration can reach. A backward pass limits it to a
    value from which the body can brake in time. Then the function splits each segment
    into up to three pieces: speeding up, constant speed, and braking. ``limits`` has
    the top speed on each segment, m/s.
    """
    tops = [limit * limit for limit in limits]
    joints = [0.0, *(min(pair) for pair in pairwise(tops)), 0.0]
    gains = [2.0 * acceleration * segment.length for segment in segments]
    for k, gain in enumerate(gains):
        joints[k + 1] = min(joints[k + 1], joints[k] + gain)
    for k, gain in reversed(list(enumerate(gains))):
        joints[k] = min(joints[k], joints[k + 1] + gain)
    pieces: list[_Piece] = []
    begin = 0.0
    for segment, top, gain, (first, last) in zip(
        segments, tops, gains, pairwise(joints), strict=True
    ):
        peak = min(top, 0.5 * (first + last + gain))
        up = (peak - first) / (2.0 * acceleration)
        down = (peak - last) / (2.0 * acceleration)
        ways = (
            (0.0, up, first, peak, acceleration),
            (up, segment.length - up - down, peak, peak, 0.0),
            (segment.length - down, down, peak, last, -acceleration),
        )
        for start, way, before, after, rate in ways:
            if way > 0.0:
                speed = math.sqrt(before)
                pose = segment.pose(start)
                piece = _Piece(begin, *pose, segment.curvature, speed, rate)
                pieces.append(piece)
                begin += 2.0 * way / (speed + math.sqrt(after))
    return pieces, begin


def _segments(
    waypoints: Sequence[tuple[float, float]], corner_radius: float
) -> list[_Segment]:
    """Computes the lines between the waypoints, and the arcs that join the lines."""
    legs = []
    for (x0, y0), (x1, y1) in pairwise(waypoints):
        length = math.hypot(x1 - x0, y1 - y0)
        if length < 1e-9:
            raise InputError(
                "waypoints_m",
                f"({x0}, {y0}) is listed twice in a row; remove one of them",
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
                raise InputError(
                    "waypoints_m",
                    f"the path doubles back at waypoint {index + 1}; "
                    "move a waypoint aside, or use at_end: shuttle",
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
    """Returns (curvature, length) of the arc, and the length it cuts off each leg."""
    if abs(turn) < 1e-9:
        return None, 0.0
    half = math.tan(abs(turn) / 2.0)
    radius = min(radius, room / half)
    arc = (math.copysign(1.0 / radius, turn), radius * abs(turn))
    return arc, radius * half


def seconds(context: Any) -> float:
    """Returns the time of a context as a float, for any scalar type."""
    time = context.get_time()
    return time if isinstance(time, float) else time.value()
