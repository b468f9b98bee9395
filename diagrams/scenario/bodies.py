"""Moving rectangles, and the surroundings of one robot."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from systems.base.robot import RobotParameters, microphones_B
from systems.world.plane import rotate


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
    """A rectangle that moves along a path."""

    path: Path
    """Pose of its center over time."""
    size: tuple[float, float]
    """Length and width, m."""

    def rectangle(self, time: float) -> NDArray[np.float64]:
        """(5,) x, y, theta, length, width in W at a time in s."""
        return np.array([*self.path.pose(time), *self.size])

    def rectangles(self, times: ArrayLike) -> NDArray[np.float64]:
        """(n, 5) rectangles at several times."""
        return rectangles_at(self.path.poses(times), self.size)


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
            return Body(self.goal, (0.0, 0.0))
        return self.bodies[self.target]

    @cached_property
    def obstacles(self) -> dict[str, Body]:
        """All bodies except the target."""
        return {k: body for k, body in self.bodies.items() if k != self.target}


def rectangles_at(
    poses: NDArray[np.float64], size: tuple[float, float]
) -> NDArray[np.float64]:
    """Returns rectangles of the same size at several poses.

    Args:
        poses: (n, 3) poses (x, y, theta) of the centers, m and rad.
        size: Length and width of all rectangles, m.

    Returns:
        (n, 5) rectangles (x, y, theta, length, width), m and rad.
    """
    rectangles = np.empty((len(poses), 5))
    rectangles[:, :3], rectangles[:, 3:] = poses, size
    return rectangles


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
        (5,) rectangle (x, y, theta, length, width) in W, m and rad.
    """
    x, y, theta = np.asarray(pose_WB)
    return np.array([x, y, theta, robot.length_m, robot.width_m])
