"""Computes how near a robot came to other bodies: clearance and time to contact."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from diagrams.running.run_result import RunResult
from systems.framework.compiling import njit
from systems.world.contacts import contact_time
from systems.world.geometry import rectangle_clearance
from systems.world.shapes import box

Floats = NDArray[np.float64]

#: Clearance below which clearances are also computed between two ticks, m.
NEAR_M = 0.1
#: Number of parts into which the time between two ticks is then divided.
PARTS = 10


@dataclass(frozen=True)
class Proximity:
    """Distances between the rectangle of a robot and all bodies that it can hit.

    The rectangle is the real outline of the robot, not an enclosing disc. A tick is a
    control period.
    """

    result: RunResult

    @cached_property
    def robot(self) -> Floats:
        """(n, 6) rectangles of the robot at the ticks, see ``systems.world.plane``."""
        shape = box(self.result.scenario.only.size)
        return shape.at(self.result.poses("WB"))[0]

    @cached_property
    def bodies(self) -> Floats:
        """(m, n, 6) rectangles of all bodies at n ticks.

        The target of the robot comes last. A target without a body is not included.
        """
        around, time = self.result.surroundings, self.result.time
        bodies = [body.rectangles_over(time) for body in around.obstacles.values()]
        if around.goal is None:
            bodies.append(around.followed.shape.at(self.result.poses("WS")))
        return np.concatenate([np.empty((0, len(time), 6)), *bodies])

    @property
    def clearance(self) -> Floats:
        """(n,) distance to the nearest body at the ticks, m; negative inside a body."""
        return self._clearances[0]

    @cached_property
    def least(self) -> Floats:
        """(k,) least clearance from each body, including the time between ticks, m.

        The order is that of ``bodies``, with one value for all rectangles of a body.
        A body can pass the robot between two ticks. Therefore the time between two
        ticks is divided into ten parts if one of two conditions holds:

        - At one of the two ticks, the clearance from the nearest body is below
          ``NEAR_M``.
        - Between the two ticks, the robot and the fastest body together move farther
          than the clearance at one of these ticks.

        At the additional times, the poses of robots are interpolated. The other bodies
        have the exact poses of their paths.
        """
        least = self._least
        counts = [
            len(body.shape.rectangles)
            for body in self.result.surroundings.bodies.values()
        ]
        ends = np.cumsum(counts, dtype=int)
        return np.array([part.min() for part in np.split(least, ends)[:-1]])

    @cached_property
    def _least(self) -> Floats:
        """(m,) least clearance from each rectangle of ``bodies``, m; see ``least``."""
        clearance, least = self._clearances
        gone = np.hypot(*np.diff(self.robot[:, :2], axis=0).T)
        if len(self.bodies):
            ways = np.diff(self.bodies[:, :, :2], axis=1)
            gone = gone + np.hypot(ways[..., 0], ways[..., 1]).max(axis=0)
        near = np.minimum(clearance[:-1], clearance[1:]) < np.maximum(NEAR_M, gone)
        ticks = np.flatnonzero(near)
        if len(ticks) == 0:
            return least
        part = np.arange(1, PARTS) / PARTS
        time, poses = self.result.time, self.result.poses("WB")
        times = (time[ticks, None] + part * np.diff(time)[ticks, None]).ravel()
        step = np.diff(poses, axis=0)[ticks]
        between = poses[ticks, None] + part[:, None] * step[:, None]
        robot = box(self.result.scenario.only.size).at(between.reshape(-1, 3))[0]
        paths = self.result.surroundings.bodies.values()
        rows = [body.rectangles_over(times) for body in paths]
        bodies = np.concatenate([np.empty((0, len(times), 6)), *rows])
        return np.minimum(least, least_clearances(robot, bodies)[1])

    @cached_property
    def least_time_to_contact(self) -> float:
        """Least predicted time to a contact, over all ticks (control periods), s.

        The prediction at a tick assumes that the robot and the bodies do not turn, and
        that their centers keep their velocities. The value is infinite if no contact is
        ever predicted.
        """
        if len(self.result.time) < 2:
            return math.inf
        velocity = self.result.vector("v_WB")
        return _least_contact_time(self.result.time, self.robot, velocity, self.bodies)

    @cached_property
    def _clearances(self) -> tuple[Floats, Floats]:
        return least_clearances(self.robot, self.bodies)


@njit(cache=True)
def least_clearances(
    robot: Floats, bodies: Floats
) -> tuple[Floats, Floats]:  # pragma: no cover  (compiled)
    """Computes the least clearances between a moving rectangle and other rectangles.

    The robot (n, 6) and the m other rectangles (m, n, 6) are (x, y, theta, length,
    width, radius) at n times, m and rad. The function returns the (n,) clearance from
    the nearest rectangle at each time and the (m,) least clearance from each rectangle
    over all times, m. If rectangles overlap, the clearance is negative.

    To save time, the function skips a rectangle at times at which the enclosing circles
    of both rectangles are far apart.
    """
    count, ticks = bodies.shape[:2]
    nearest, least = np.full(ticks, np.inf), np.full(count, np.inf)
    reaches = _reaches(robot, bodies)
    first = 0
    for i in range(ticks):
        # The loop begins with the body that was nearest at the last tick. It can then
        # skip more of the other bodies.
        begin = first
        for j in range(count):
            k = (begin + j) % count
            apart = _gap(robot[i], bodies[k, i], reaches[k])
            if apart > 0.0 and apart >= nearest[i] and apart >= least[k]:
                continue
            clearance = rectangle_clearance(robot[i], bodies[k, i])
            least[k] = min(least[k], clearance)
            if clearance < nearest[i]:
                nearest[i], first = clearance, k
    return nearest, least


@njit(cache=True)
def _least_contact_time(
    time: Floats, robot: Floats, velocity: Floats, bodies: Floats
) -> float:  # pragma: no cover  (compiled)
    """Computes the least predicted time to a contact, over all ticks and bodies, s.

    The time is infinite if no contact is predicted. The velocity (2, n) is in m/s; for
    the rectangles, see ``least_clearances``.
    """
    least, reaches = np.inf, _reaches(robot, bodies)
    for k in range(len(bodies)):
        x, y = bodies[k, :, 0], bodies[k, :, 1]
        for i in range(time.size):
            vx = velocity[0, i] - _rate(time, x, i)
            vy = velocity[1, i] - _rate(time, y, i)
            apart = _gap(robot[i], bodies[k, i], reaches[k])
            if apart > 0.0:
                # Before a contact, the enclosing circles touch. The gap between them
                # closes at most as fast as their centers now approach each other.
                dx, dy = x[i] - robot[i, 0], y[i] - robot[i, 1]
                nearing = (dx * vx + dy * vy) / (apart + reaches[k])
                if nearing <= 0.0 or apart >= least * nearing:
                    continue
            least = min(least, contact_time(robot[i], bodies[k, i], vx, vy))
    return least


@njit(cache=True)
def _reaches(robot: Floats, bodies: Floats) -> Floats:  # pragma: no cover  (compiled)
    """(m,) radius of the robot's enclosing circle plus that of each body's, m."""
    reaches = np.empty(len(bodies))
    for k in range(len(bodies)):
        a, b = robot[0], bodies[k, 0]
        reaches[k] = 0.5 * (math.hypot(a[3], a[4]) + math.hypot(b[3], b[4])) + b[5]
    return reaches


@njit(cache=True)
def _gap(a: Floats, b: Floats, reach: float) -> float:  # pragma: no cover  (compiled)
    """Gap between the enclosing circles of two rectangles, m; negative in overlap."""
    dx, dy = a[0] - b[0], a[1] - b[1]
    return math.sqrt(dx * dx + dy * dy) - reach


@njit(cache=True)
def _rate(
    time: Floats, values: Floats, i: int
) -> float:  # pragma: no cover  (compiled)
    """Derivative of the values at a tick, from a parabola through the neighbors."""
    if i == 0:
        return (values[1] - values[0]) / (time[1] - time[0])
    before = time[i] - time[i - 1]
    slope_before = (values[i] - values[i - 1]) / before
    if i == time.size - 1:
        return slope_before
    after = time[i + 1] - time[i]
    slope_after = (values[i + 1] - values[i]) / after
    return (after * slope_before + before * slope_after) / (before + after)
