"""Gives the motion of a robot that carries a loudspeaker as a function of time.

The module ``systems/base/carrier.py`` computes the motion. Because ``carrier.py`` has
compiled code, it is imported only when a pose or velocity of a moving robot is needed.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from systems.base.source_drive import value_weights
from systems.framework.signals import TICK_S
from systems.world.paths import WaypointPath

#: Time from the end of the plan until the velocity is set to zero, s. At the end of
#: this time, the feedback moves the robot at less than 1 nm/s.
_SETTLING_S = 10.0

#: Least number of ticks that are computed at once.
_CHUNK_TICKS = 400


class DrivenPath:
    """Pose and velocity of a robot with wheels that drives through waypoints.

    From the start time on, the wheel commands change every 25 ms. This period (tick)
    does not depend on the control period of the follower robots. Between ticks, the
    pose is a cubic Hermite polynomial. This polynomial differs from the exact motion by
    at most 1 um and 10 urad.

    In the scenarios of the library, the robot stays within 2 mm of its plan. If it
    turns corners at 0.7 m/s, it stays within 2 cm of its plan. It stops within 5 mm of
    the last waypoint.

    Args:
        plan: Planned path.
        start_time_s: Time until which the robot rests at the first waypoint, s.
        stops: Whether the robot rests at the end of its plan.
    """

    def __init__(self, plan: WaypointPath, *, start_time_s: float, stops: bool) -> None:
        self._start, self._plan = start_time_s, plan
        self.moves = plan.moves
        """Whether the robot ever leaves its first waypoint."""
        self.length = plan.length
        """Length of the planned path, m."""
        self._rest = plan.pose(0.0)
        self._end = math.inf
        if stops:
            self._end = math.ceil((plan.duration + _SETTLING_S) / TICK_S)
        # States (pose, velocity, and wheel speeds) at the ticks so far, as lists and
        # as an array. Lists give faster access to a single row.
        self._knots = [[*self._rest, 0.0, 0.0, 0.0, 0.0, 0.0]]
        self._table = np.array(self._knots)

    def _drive_on(self, tick: int) -> None:
        """Computes knots at least up to the tick after ``tick``, or up to the end."""
        from systems.base.carrier import drive_along

        knots = self._knots
        first = len(knots) - 1
        if first == self._end:
            return
        last = min(first + max(tick + 1 - first, _CHUNK_TICKS), self._end)
        rows = drive_along(self._plan, (first, int(last)), knots[-1])
        if last == self._end:
            rows[-1, 3:] = 0.0
        self._knots = knots + rows.tolist()
        self._table = np.vstack([self._table, rows])

    def _since(self, ticks: float) -> tuple[float, list[float], list[float]]:
        """Returns the elapsed share of a tick, and the knots at its start and end."""
        if ticks >= len(self._knots) - 1:
            self._drive_on(int(min(ticks, self._end)))
        k = min(int(ticks), len(self._knots) - 2)
        return min(ticks - k, 1.0), self._knots[k], self._knots[k + 1]

    def pose(self, time: float) -> tuple[float, float, float]:
        """Returns (x, y, theta) in W, m and rad, at a time in s."""
        if not self.moves or time <= self._start:
            return self._rest
        s, a, b = self._since((time - self._start) / TICK_S)
        p, q, r = value_weights(s)
        return (
            a[0] + p * (b[0] - a[0]) + q * a[3] + r * b[3],
            a[1] + p * (b[1] - a[1]) + q * a[4] + r * b[4],
            a[2] + p * (b[2] - a[2]) + q * a[5] + r * b[5],
        )

    def poses(self, times: ArrayLike) -> NDArray[np.float64]:
        """Returns the (n, 3) poses in W, m and rad, at n times in s; see ``pose``."""
        times = np.asarray(times, dtype=float)
        if not self.moves or not len(times):
            return np.full((len(times), 3), self._rest)
        from systems.base.carrier import poses_between

        ticks = np.maximum((times - self._start) / TICK_S, 0.0)
        self._since(ticks.max())
        return poses_between(self._table, ticks)

    def velocity(self, time: float) -> tuple[float, float, float]:
        """Returns (vx, vy, omega) in W, m/s and rad/s, at a time in s."""
        if not self.moves or time <= self._start:
            return (0.0, 0.0, 0.0)
        s, a, b = self._since((time - self._start) / TICK_S)
        p = 6.0 * s * (1.0 - s) / TICK_S
        q, r = (1.0 - s) * (1.0 - 3.0 * s), s * (3.0 * s - 2.0)
        return (
            p * (b[0] - a[0]) + q * a[3] + r * b[3],
            p * (b[1] - a[1]) + q * a[4] + r * b[4],
            p * (b[2] - a[2]) + q * a[5] + r * b[5],
        )

    def extreme_twists(self, until: float) -> NDArray[np.float64]:
        """Returns the speeds and yaw rates at all ticks (25 ms each) up to a time.

        Within a tick, the speed of each wheel approaches its command. Therefore every
        point of the body is fastest at the start or at the end of a tick.

        Args:
            until: The time, s. It is rounded up to a whole tick.

        Returns:
            (n, 2) array. The columns are the forward speed, m/s, and the yaw rate,
            rad/s.
        """
        ticks = max(until - self._start, 0.0) / TICK_S
        if not self.moves:
            return np.zeros((1, 2))
        self._since(ticks)
        table = self._table[: math.ceil(ticks) + 1]
        return np.column_stack([np.hypot(table[:, 3], table[:, 4]), table[:, 5]])
