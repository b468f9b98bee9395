"""How near the robot came to what it can hit: clearance and time to contact."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numba import njit
from numpy.typing import NDArray

from diagrams.simulation import RunResult
from systems.world.geometry import beyond_rectangle, contact_time, rectangle_clearance

__all__ = ["Proximity"]

#: Below this clearance the time between two ticks is searched, m: more than robot
#: and obstacle cover in a tick.
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
        return _rectangles(self.result, self.result.poses("WB"))

    @cached_property
    def bodies(self) -> NDArray[np.float64]:
        """(m, n, 5) the bodies' rectangles at the ticks, what is followed last."""
        bodies = self.result.surroundings.bodies.values()
        return np.stack([body.rectangles(self.result.time) for body in bodies])

    @cached_property
    def clearances(self) -> NDArray[np.float64]:
        """(m, n) distance to each body at the ticks, m; negative depth inside."""
        return _clearances(self.robot, self.bodies)

    @property
    def clearance(self) -> NDArray[np.float64]:
        """(n,) distance to the nearest body at the ticks, m."""
        return np.min(self.clearances, axis=0)

    @cached_property
    def least(self) -> NDArray[np.float64]:
        """(m,) least clearance from each body, between ticks too, m.

        A tick's clearance says little about a box that passes in 25 ms. Where
        it is below ``NEAR_M`` a tick is cut into ten: the robot's pose is
        interpolated, the bodies are where their paths say, and other robots on
        straight lines between ticks.
        """
        least = np.min(self.clearances, axis=1)
        near = self.clearance < NEAR_M
        ticks = np.flatnonzero(near[:-1] | near[1:])
        if len(ticks) == 0:
            return least
        part = np.arange(1, PARTS) / PARTS
        time, poses = self.result.time, self.result.poses("WB")
        times = (time[ticks, None] + part * np.diff(time)[ticks, None]).ravel()
        step = np.diff(poses, axis=0)[ticks]
        between = poses[ticks, None] + part[:, None] * step[:, None]
        robot = _rectangles(self.result, between.reshape(-1, 3))
        paths = self.result.surroundings.bodies.values()
        bodies = np.stack([body.rectangles(times) for body in paths])
        return np.minimum(least, np.min(_clearances(robot, bodies), axis=1))

    @cached_property
    def time_to_contact(self) -> NDArray[np.float64]:
        """(n,) time to the first contact if all went on as at each tick, s.

        Every rectangle keeps its heading and the velocity of its centre;
        infinite where nothing would touch.
        """
        time = self.result.time
        if len(time) < 2:
            return np.full(len(time), np.inf)
        robot = self.result.vector("v_WB").T
        bodies = np.gradient(self.bodies[:, :, :2], time, axis=1)
        return _contact_times(self.robot, self.bodies, robot - bodies)

    def distances_from_P(self) -> NDArray[np.float64]:
        """(m, n) distance from P to each body's rectangle at the ticks, m."""
        p_WP, bodies = self.result.vector("p_WP"), np.moveaxis(self.bodies, 2, 0)
        return np.hypot(*beyond_rectangle(p_WP, bodies))


def _rectangles(result: RunResult, poses: NDArray[np.float64]) -> NDArray[np.float64]:
    robot = result.scenario.robot
    size = np.array([robot.length_m, robot.width_m])
    return np.hstack([poses, np.tile(size, (len(poses), 1))])


@njit(cache=True)
def _clearances(
    robot: NDArray[np.float64], bodies: NDArray[np.float64]
) -> NDArray[np.float64]:  # pragma: no cover  (compiled)
    """(m, n) clearance of (n, 5) and (m, n, 5) rectangles, m."""
    clearances = np.empty(bodies.shape[:2])
    for k in range(bodies.shape[0]):
        for i in range(bodies.shape[1]):
            clearances[k, i] = rectangle_clearance(robot[i], bodies[k, i])
    return clearances


@njit(cache=True)
def _contact_times(
    robot: NDArray[np.float64],
    bodies: NDArray[np.float64],
    velocities: NDArray[np.float64],
) -> NDArray[np.float64]:  # pragma: no cover  (compiled)
    """(n,) least contact time over the bodies; velocities (m, n, 2), m/s."""
    times = np.full(robot.shape[0], np.inf)
    for k in range(bodies.shape[0]):
        for i in range(bodies.shape[1]):
            vx, vy = velocities[k, i]
            time = contact_time(robot[i], bodies[k, i], vx, vy)
            times[i] = min(times[i], time)
    return times
