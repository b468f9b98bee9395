"""Bodies that rest or move, and the surroundings of one robot."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from systems.base.robot import RobotParameters, microphones_B
from systems.world.plane import beyond_rectangle, rectangle_clearance, rotate
from systems.world.shapes import Shape, box

#: Distance that is far above the rounding errors of distances, m.
_ROUNDING_M = 1e-9


class Path(Protocol):
    """A pose as a function of time."""

    @property
    def moves(self) -> bool:
        """Whether the pose ever changes."""

    def pose(self, time: float) -> tuple[float, float, float]:
        """(x, y, theta) in W, m and rad, at a time in s."""

    def poses(self, times: ArrayLike) -> NDArray[np.float64]:
        """(n, 3) poses at several times."""


@dataclass(frozen=True)
class RecordedPath:
    """Poses of a robot at ticks of a run, with linear interpolation."""

    times: NDArray[np.float64]
    """(n,) ascending times, s."""
    recorded: NDArray[np.float64]
    """(n, 3) x, y, theta in W, m and rad; angles are not wrapped."""

    moves = True

    def pose(self, time: float) -> tuple[float, float, float]:
        """(x, y, theta) in W, m and rad, at a time in s."""
        x, y, theta = self.poses([time])[0].tolist()
        return x, y, theta

    def poses(self, times: ArrayLike) -> NDArray[np.float64]:
        """(n, 3) poses at several times; constant before and after the run."""
        at = np.asarray(times, dtype=float)
        return np.column_stack(
            [np.interp(at, self.times, column) for column in self.recorded.T]
        )


class Body(NamedTuple):
    """A shape that moves along a path."""

    path: Path
    """Pose of its axes over time."""
    shape: Shape

    def rectangles(self, time: float) -> NDArray[np.float64]:
        """(n, 6) x, y, theta, length, width, radius in W at a time in s."""
        return self.shape.at(self.path.pose(time))

    def rectangles_over(self, times: ArrayLike) -> NDArray[np.float64]:
        """(n, m, 6) rectangles at m times, see ``rectangles``."""
        return self.shape.at(self.path.poses(times))

    def distance(self, point: tuple[float, float], time: float) -> float:
        """Returns the distance of a point in W from the body, m; 0 inside the body.

        ``time`` is in s.
        """
        if self.fills(point, time):
            return 0.0
        return _least(
            lambda row: math.hypot(*beyond_rectangle(point, row)),
            self.rectangles(time),
            (*point, 0.0),
        )

    def clearance(self, rectangle: NDArray[np.float64], time: float) -> float:
        """Returns the clearance between the body and a (6,) rectangle in W, m.

        If they overlap, the clearance is negative. Inside a polygon, it is -inf.
        ``time`` is in s.
        """
        if self.fills((rectangle[0], rectangle[1]), time):
            return -math.inf
        x, y, _, length, width, radius = rectangle.tolist()
        return _least(
            lambda row: rectangle_clearance(rectangle, row),
            self.rectangles(time),
            (x, y, 0.5 * math.hypot(length, width) + radius),
        )

    def fills(self, point: tuple[float, float], time: float) -> bool:
        """Returns whether a point in W is inside the polygon of the body.

        ``time`` is in s. A body without a polygon has no such points.
        """
        if self.shape.polygon is None:
            return False
        x, y, theta = self.path.pose(time)
        own = rotate(-theta, point[0] - x, point[1] - y)
        return bool(self.shape.fills(own))


def _least(
    distance: Callable[[NDArray[np.float64]], float],
    rectangles: NDArray[np.float64],
    circle: tuple[float, float, float],
) -> float:
    """Returns the least distance, m, between a body and one of many rectangles.

    ``distance`` computes the distance from one rectangle. ``circle`` (x, y, radius), m,
    encloses the body. A rectangle whose enclosing circle is too far away is skipped.
    """
    x, y, radius = circle
    extents = np.hypot(rectangles[:, 3], rectangles[:, 4])
    gaps = np.hypot(rectangles[:, 0] - x, rectangles[:, 1] - y)
    gaps -= 0.5 * extents + rectangles[:, 5] + radius + _ROUNDING_M
    least = math.inf
    for k in np.argsort(gaps):
        if gaps[k] > 0.0 and gaps[k] >= least:
            break
        least = min(least, distance(rectangles[k]))
    return least


@dataclass(frozen=True)
class Surroundings:
    """The bodies that one robot can hit, and the target of this robot."""

    bodies: Mapping[str, Body]
    """Bodies by name, in this order: obstacles, other robots, other sources, and the
    target. A goal is not a body.
    """
    target: str
    """Name of the target: the source, the leader, or the goal."""
    goal: Path | None = None
    """Path of the goal, if the robot drives to a goal; None: the target is a body."""

    @property
    def followed(self) -> Body:
        """The target. If the target is a goal, it has no extent and cannot be hit."""
        if self.goal is not None:
            return Body(self.goal, box((0.0, 0.0)))
        return self.bodies[self.target]

    @cached_property
    def obstacles(self) -> dict[str, Body]:
        """All bodies except the target."""
        return {k: body for k, body in self.bodies.items() if k != self.target}

    @property
    def owners(self) -> tuple[int, ...]:
        """Index in ``obstacles`` of the body of each rectangle, in the same order."""
        counts = [len(body.shape.rectangles) for body in self.obstacles.values()]
        return tuple(np.repeat(np.arange(len(counts)), counts).tolist())


def microphones_W(pose_WB: ArrayLike, robot: RobotParameters) -> NDArray[np.float64]:
    """Returns the positions of a robot's microphones in the world frame W.

    Args:
        pose_WB: Pose (x, y, theta) of the robot in W, m and rad.
        robot: Parameters of the robot, with the positions in its body frame B.

    Returns:
        (n, 2) positions in W, m.
    """
    x, y, theta = np.asarray(pose_WB)
    return np.array([x, y]) + np.stack(rotate(theta, *microphones_B(robot).T), axis=1)


def robot_rectangle(pose_WB: ArrayLike, robot: RobotParameters) -> NDArray[np.float64]:
    """Returns the footprint of a robot, a rectangle around the origin of its frame B.

    Args:
        pose_WB: Pose (x, y, theta) of the robot's body frame B in the world frame W, m
            and rad.
        robot: Parameters of the robot, with its size.

    Returns:
        (6,) rectangle (x, y, theta, length, width, radius 0) in W, m and rad.
    """
    x, y, theta = np.asarray(pose_WB)
    return np.array([x, y, theta, robot.length_m, robot.width_m, 0.0])
