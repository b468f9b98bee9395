"""How near the robot came to what it can hit: clearance and time to contact."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from diagrams.running.run_result import RunResult
from diagrams.scenario.bodies import rectangles_at
from systems.framework.compiling import njit
from systems.world.geometry import contact_time, rectangle_clearance

#: Below this clearance the time between two ticks is searched, m, and below what robot
#: and body cover in it.
NEAR_M = 0.1
#: Parts into which a tick is cut there.
PARTS = 10


@dataclass(frozen=True)
class Proximity:
    """The robot's footprint beside all bodies, of which it follows the last.

    The footprint is the real rectangle, not a disc round it.
    """

    result: RunResult

    @cached_property
    def robot(self) -> NDArray[np.float64]:
        """(n, 5) the robot's rectangle at the ticks."""
        return rectangles_at(self.result.poses("WB"), self.result.scenario.only.size)

    @cached_property
    def bodies(self) -> NDArray[np.float64]:
        """(m, n, 5) the bodies' rectangles at the ticks, what is followed last."""
        around, time = self.result.surroundings, self.result.time
        bodies = [body.rectangles(time) for body in around.obstacles.values()]
        if around.goal is None:
            size = around.followed.size
            bodies.append(rectangles_at(self.result.poses("WS"), size))
        return np.reshape(bodies, (-1, len(time), 5))

    @property
    def clearance(self) -> NDArray[np.float64]:
        """(n,) distance to the nearest body at the ticks, m; negative depth inside."""
        return self._clearances[0]

    @cached_property
    def least(self) -> NDArray[np.float64]:
        """(m,) least clearance from each body, between ticks too, m.

        A tick's clearance says little about a box that passes in 25 ms. Where
        it is below ``NEAR_M``, or below what both cover in the tick, the tick is cut
        into ten: the robot's pose is interpolated, the bodies are where their paths
        say, and other robots on straight lines between ticks.
        """
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
        robot = rectangles_at(between.reshape(-1, 3), self.result.scenario.only.size)
        paths = self.result.surroundings.bodies.values()
        bodies = np.reshape(
            [body.rectangles(times) for body in paths], (-1, len(times), 5)
        )
        return np.minimum(least, least_clearances(robot, bodies)[1])

    @cached_property
    def least_time_to_contact(self) -> float:
        """Time to the first contact if all went on as at a tick, the least, s.

        Every rectangle keeps its heading and the velocity of its centre;
        infinite where nothing would touch.
        """
        if len(self.result.time) < 2:
            return math.inf
        velocity = self.result.vector("v_WB")
        return _least_contact_time(self.result.time, self.robot, velocity, self.bodies)

    @cached_property
    def _clearances(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return least_clearances(self.robot, self.bodies)


@njit(cache=True)
def least_clearances(
    robot: NDArray[np.float64], bodies: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:  # pragma: no cover  (compiled)
    """Least clearances of a rectangle from others, at times and of others.

    A body is passed over where the circles round both are so far apart that it
    is neither the nearest one nor as near as before.

    Args:
        robot: (n, 5) at n times.
        bodies: (m, n, 5) the others.

    Returns:
        (n,) and (m,) m; negative where they overlap.
    """
    count, ticks = bodies.shape[:2]
    nearest, least = np.full(ticks, np.inf), np.full(count, np.inf)
    reaches = _reaches(robot, bodies)
    first = 0
    for i in range(ticks):
        # What was nearest at the last tick is first, so that others are passed over.
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
    time: NDArray[np.float64],
    robot: NDArray[np.float64],
    velocity: NDArray[np.float64],
    bodies: NDArray[np.float64],
) -> float:  # pragma: no cover  (compiled)
    """Least contact time over ticks and bodies, s.

    Args:
        time: (n,) of the ticks, s.
        robot: (n, 5) rectangles.
        velocity: (2, n) of the robot, m/s.
        bodies: (m, n, 5) rectangles.
    """
    least, reaches = np.inf, _reaches(robot, bodies)
    for k in range(len(bodies)):
        x, y = bodies[k, :, 0], bodies[k, :, 1]
        for i in range(time.size):
            vx = velocity[0, i] - _rate(time, x, i)
            vy = velocity[1, i] - _rate(time, y, i)
            apart = _gap(robot[i], bodies[k, i], reaches[k])
            if apart > 0.0:
                # The circles touch first, if ever, and their gap closes no faster
                # than their centres come nearer now.
                dx, dy = x[i] - robot[i, 0], y[i] - robot[i, 1]
                nearing = (dx * vx + dy * vy) / (apart + reaches[k])
                if nearing <= 0.0 or apart >= least * nearing:
                    continue
            least = min(least, contact_time(robot[i], bodies[k, i], vx, vy))
    return least


@njit(cache=True)
def _reaches(
    robot: NDArray[np.float64], bodies: NDArray[np.float64]
) -> NDArray[np.float64]:  # pragma: no cover  (compiled)
    """(m,) radii of the circles round robot and body together, m."""
    reaches = np.empty(len(bodies))
    for k in range(len(bodies)):
        a, b = robot[0], bodies[k, 0]
        reaches[k] = 0.5 * (math.hypot(a[3], a[4]) + math.hypot(b[3], b[4]))
    return reaches


@njit(cache=True)
def _gap(
    a: NDArray[np.float64], b: NDArray[np.float64], reach: float
) -> float:  # pragma: no cover  (compiled)
    """Between the circles round two rectangles, m; negative where they overlap."""
    dx, dy = a[0] - b[0], a[1] - b[1]
    return math.sqrt(dx * dx + dy * dy) - reach


@njit(cache=True)
def _rate(
    time: NDArray[np.float64], values: NDArray[np.float64], i: int
) -> float:  # pragma: no cover  (compiled)
    """Derivative at a tick, of a parabola through its neighbours."""
    if i == 0:
        return (values[1] - values[0]) / (time[1] - time[0])
    before = time[i] - time[i - 1]
    slope_before = (values[i] - values[i - 1]) / before
    if i == time.size - 1:
        return slope_before
    after = time[i + 1] - time[i]
    slope_after = (values[i + 1] - values[i]) / after
    return (after * slope_before + before * slope_after) / (before + after)
