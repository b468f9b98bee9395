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
    """Returns a message with a header.

    Args:
        time: Time stamp, s.
        frame: Name of the frame in which the fields are given.
        **fields: All other fields of the message.

    Returns:
        The message.
    """
    sec, nanosec = divmod(round(1e9 * time), 10**9)
    stamp = {"sec": sec, "nanosec": nanosec}
    return {"header": {"stamp": stamp, "frame_id": frame}, **fields}


def vector(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Message:
    """Returns a ``Vector3`` or ``Point`` message.

    Args:
        x: x component, in any unit.
        y: y component, in the same unit.
        z: z component, in the same unit.

    Returns:
        The message.
    """
    return {"x": x, "y": y, "z": z}


def _turn(theta: float) -> Message:
    """Returns the quaternion of a rotation about z by an angle, rad."""
    return {**vector(z=math.sin(0.5 * theta)), "w": math.cos(0.5 * theta)}


def pose(at: Sequence[float], height_m: float = 0.0) -> Message:
    """Returns a ``Pose`` message.

    Args:
        at: Pose (x, y, theta), m and rad.
        height_m: Height above the floor, m.

    Returns:
        The message.
    """
    x, y, theta = at
    return {"position": vector(x, y, height_m), "orientation": _turn(theta)}


def stamped_pose(time: float, at: Sequence[float]) -> Message:
    """Returns a ``PoseStamped`` message in the world frame W.

    Args:
        time: Time stamp, s.
        at: Pose (x, y, theta) in W, m and rad.

    Returns:
        The message.
    """
    return stamped(time, WORLD_FRAME, pose=pose(at))


def transform(time: float, parent: str, child: str, at: Sequence[float]) -> Message:
    """Returns a ``TransformStamped`` message.

    Args:
        time: Time stamp, s.
        parent: Name of the parent frame.
        child: Name of the child frame.
        at: Pose (x, y, theta) of the child frame in the parent frame, m and rad.

    Returns:
        The message.
    """
    x, y, theta = at
    placed = {"translation": vector(x, y), "rotation": _turn(theta)}
    return stamped(time, parent, child_frame_id=child, transform=placed)
