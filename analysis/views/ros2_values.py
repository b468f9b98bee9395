"""Makes values of ROS 2 messages: times, poses and transforms in the plane."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

#: A message, as its fields by name.
Message = dict[str, Any]
#: Name of the world frame W.
WORLD_FRAME = "world"


def stamped(time: float, frame: str, **fields: Any) -> Message:
    """Returns a message with a header, with the time in s and the name of its frame."""
    sec, nanosec = divmod(round(1e9 * time), 10**9)
    stamp = {"sec": sec, "nanosec": nanosec}
    return {"header": {"stamp": stamp, "frame_id": frame}, **fields}


def vector(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Message:
    """Returns a ``Vector3`` or ``Point`` message, in any unit."""
    return {"x": x, "y": y, "z": z}


def _turn(theta: float) -> Message:
    """Returns the quaternion of a rotation about z by an angle, rad."""
    return {**vector(z=math.sin(0.5 * theta)), "w": math.cos(0.5 * theta)}


def pose(at: Sequence[float], height_m: float = 0.0) -> Message:
    """Returns a ``Pose`` message of a pose (x, y, theta), m and rad."""
    x, y, theta = at
    return {"position": vector(x, y, height_m), "orientation": _turn(theta)}


def stamped_pose(time: float, at: Sequence[float]) -> Message:
    """Returns a ``PoseStamped`` message of a pose (x, y, theta) in W, m and rad."""
    return stamped(time, WORLD_FRAME, pose=pose(at))


def transform(time: float, parent: str, child: str, at: Sequence[float]) -> Message:
    """Returns a ``TransformStamped`` message.

    ``at`` is the pose (x, y, theta) of the child frame in the parent frame, m and rad.
    """
    x, y, theta = at
    placed = {"translation": vector(x, y), "rotation": _turn(theta)}
    return stamped(time, parent, child_frame_id=child, transform=placed)
