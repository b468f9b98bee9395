"""Describes the path of a body that moves through waypoints.

Circular arcs replace the corners between the waypoints. The speed rises and falls with
a limited acceleration. Position and velocity are continuous, and explicit formulas give
them at any time. The heading is continuous up to whole turns.

The yaw rate jumps at the ends of an arc. The yaw rate of a robot with wheels cannot
jump, so ``systems/base/carrier.py`` computes the motion of such a robot.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from systems.framework.input_error import InputError
from systems.world.path_motion import AtEnd, Motion, checked_waypoints, plan_motion
from systems.world.path_pieces import Limits, Piece, rest
from systems.world.path_segments import along

#: Default acceleration of obstacles and of the leader, m/s^2 (not printed, our choice).
#: It is a tenth of the acceleration at which wheels slip on a floor. A body that starts
#: with this acceleration reaches 0.3 m/s after 45 mm. At that moment, it is 0.15 s
#: behind a body that started with 0.3 m/s.
ACCELERATION_M_S2 = 1.0

#: Speed below which a body is at rest, m/s.
_SLOWEST_M_S = 1e-9


class WaypointPath:
    """Pose and velocity of a body on a path through waypoints, as functions of time.

    The motion starts at rest. The speed along the path rises with the given
    acceleration, stays constant, and falls with the same acceleration to rest at the
    last waypoint. On a short path, the phase of constant speed is missing.

    A body that stops at a waypoint reaches the waypoint exactly. If the path bends
    there, the body turns on the spot, at up to ``TURN_RATE_RAD_S`` with
    ``TURN_ACCELERATION_RAD_S2``. A body also stops and turns where its path goes back
    on the same line.

    Args:
        waypoints: Points in the world frame W, m. With one point, the body is at rest.
        speed: Speed along the path, m/s, >= 0. With ``times``, it is the greatest
            speed that they may need.
        acceleration: Acceleration along the path, m/s^2, > 0.
        corner_radius: Largest radius of the rounded corners, m, > 0. Two lines meet at
            a corner, and the arc replaces at most half of each line.
        start_time: Time until which the body rests at the first waypoint, s.
        at_end: ``stop``: the body rests at the last waypoint. ``shuttle``: the body
            goes back and forth between both ends. It stops at each end and returns
            backward, without turning around. ``loop``: the body drives from the last
            waypoint to the first, and repeats the closed path for ever. The last
            waypoint may repeat the first.
        heading: Heading of a body with one waypoint, rad. With several waypoints, the
            heading is the tangent of the path.
        top_yaw_rate: Largest yaw rate, rad/s, > 0. It limits the speed on arcs.
        pauses: Time at each waypoint, s, or nothing. The body does not stop at a
            waypoint with the pause 0. The pause contains the turn on the spot, and it
            takes longer if the turn does.
        times: Time at which the body reaches each waypoint, s from ``start_time`` on,
            or nothing. The speed between two waypoints then follows from their times
            and the acceleration. The body passes the middle of a rounded corner at
            the time of its waypoint.

    Raises:
        InputError: There is no waypoint, two neighbors coincide, the corner radius is
            not above 0, the pauses or times do not fit the waypoints, or the times need
            a motion beyond a limit.
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
        pauses: Sequence[float] = (),
        times: Sequence[float] = (),
    ) -> None:
        if not corner_radius > 0.0:
            raise InputError(
                "corner_radius_m",
                f"at {corner_radius} m the velocity would jump at each waypoint; give "
                "a radius above 0",
            )
        course = checked_waypoints(waypoints, pauses, times, at_end)
        self._moves = len(waypoints) > 1 and speed > _SLOWEST_M_S
        self._start_time = start_time
        x, y = map(float, waypoints[0])
        pose, length = (x, y, heading), 0.0
        if len(waypoints) > 1:
            limits = Limits(speed if self._moves else 1.0, acceleration, top_yaw_rate)
            motion = plan_motion(course, at_end, corner_radius, limits)
            first = motion.pieces[0]
            pose, length = (first.x, first.y, first.theta), motion.length
        if not self._moves:
            motion = Motion([rest(0.0, pose)], math.inf, math.inf, 0.0, length)
        self._motion, self._pieces = motion, motion.pieces
        self._begins = [piece.begin for piece in self._pieces]

    @property
    def length(self) -> float:
        """Length of the path with its rounded corners, m; of a lap if it is closed."""
        return self._motion.length

    @property
    def duration(self) -> float:
        """Time from the start to the last waypoint, or of a lap, s; 0 at rest."""
        return self._motion.duration

    @property
    def moves(self) -> bool:
        """Whether the body ever leaves its first waypoint."""
        return self._moves

    def _find(self, time: float) -> tuple[Piece, float, float]:
        """Returns the piece, the distance from its start, m, and the speed, m/s.

        In a turn on the spot, the distance is in rad and the speed in rad/s.
        """
        elapsed = max(time - self._start_time, 0.0)
        begin, period = self._motion.repeats_from, self._motion.period
        if elapsed > begin:
            elapsed = begin + (elapsed - begin) % period
        piece = self._pieces[bisect_right(self._begins, elapsed) - 1]
        since = elapsed - piece.begin
        distance = (piece.speed + 0.5 * piece.acceleration * since) * since
        return piece, distance, piece.speed + piece.acceleration * since

    def pose(self, time: float) -> tuple[float, float, float]:
        """Returns (x, y, theta) in W, m and rad, at a time in s."""
        piece, s, _ = self._find(time)
        return along(*piece[1:6], s)

    def velocity(self, time: float) -> tuple[float, float, float]:
        """Returns (vx, vy, omega) in W, m/s and rad/s, at a time in s."""
        piece, s, rate = self._find(time)
        theta, forward = piece.theta + piece.curvature * s, piece.forward * rate
        return (
            forward * math.cos(theta),
            forward * math.sin(theta),
            rate * piece.curvature,
        )

    def poses(self, times: ArrayLike) -> NDArray[np.float64]:
        """Returns the (n, 3) poses in W, m and rad, at n times in s; see ``pose``."""
        times = np.asarray(times, dtype=float)
        if not self._moves:
            return np.full((len(times), 3), self._pieces[0][1:4])
        from systems.world.path_poses import poses_on  # compiled code: when it is used

        return poses_on(np.array(self._pieces), self._elapsed(times))

    def twists(self, times: ArrayLike) -> NDArray[np.float64]:
        """Returns an (n, 2) array: forward speed and yaw rate at each of n times.

        The times are in s, the speeds in m/s, and the yaw rates in rad/s. On its way
        back, a shuttle drives backward, so its speed is negative.
        """
        elapsed = self._elapsed(np.asarray(times, dtype=float))
        index = np.searchsorted(self._begins, elapsed, side="right") - 1
        begin, *_, forward, curvature, speed, acceleration = np.array(self._pieces)[
            index
        ].T
        rate = speed + acceleration * (elapsed - begin)
        return np.stack([rate * forward, rate * curvature], axis=1)

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
        ends = [*self._begins[1:], self._motion.repeats_from + self._motion.period]
        for piece, after in zip(self._pieces, ends, strict=True):
            if math.isinf(after):  # the body rests at the end of its path
                break
            if piece.begin > last:
                break
            for elapsed in (piece.begin, min(after, last)):
                rate = piece.speed + piece.acceleration * (elapsed - piece.begin)
                rows.append((rate * piece.forward, rate * piece.curvature))
        return np.reshape(rows, (-1, 2))

    def _elapsed(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """Returns the times in s since the start, in the first period if it repeats."""
        elapsed = np.maximum(times - self._start_time, 0.0)
        begin, period = self._motion.repeats_from, self._motion.period
        if not math.isfinite(period):
            return elapsed
        again = begin + np.mod(elapsed - begin, period)
        return np.where(elapsed > begin, again, elapsed)


def seconds(context: Any) -> float:
    """Returns the time of a context as a float, for any scalar type."""
    time = context.get_time()
    return time if isinstance(time, float) else time.value()
