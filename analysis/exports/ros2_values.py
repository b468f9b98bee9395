"""Values of ROS 2 messages: times, poses and transforms in the plane."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

#: Fields by name.
Message = dict[str, Any]
#: W.
WORLD_FRAME = "world"


def stamped(time: float, frame: str, **fields: Any) -> Message:
    """A message with a header.

    Args:
        time: s.
        frame: In which its fields are.
        **fields: All else.

    Returns:
        The message.
    """
    sec, nanosec = divmod(round(1e9 * time), 10**9)
    stamp = {"sec": sec, "nanosec": nanosec}
    return {"header": {"stamp": stamp, "frame_id": frame}, **fields}


def vector(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Message:
    """A ``Vector3`` or ``Point``.

    Args:
        x: Any unit.
        y: The same.
        z: The same.

    Returns:
        The message.
    """
    return {"x": x, "y": y, "z": z}


def _turn(theta: float) -> Message:
    """The rotation about z by an angle, rad."""
    return {**vector(z=math.sin(0.5 * theta)), "w": math.cos(0.5 * theta)}


def pose(at: Sequence[float], height_m: float = 0.0) -> Message:
    """A ``Pose``.

    Args:
        at: x, y, theta, m and rad.
        height_m: Above the floor, m.

    Returns:
        The message.
    """
    x, y, theta = at
    return {"position": vector(x, y, height_m), "orientation": _turn(theta)}


def stamped_pose(time: float, at: Sequence[float]) -> Message:
    """A ``PoseStamped`` in W.

    Args:
        time: s.
        at: x, y, theta, m and rad.

    Returns:
        The message.
    """
    return stamped(time, WORLD_FRAME, pose=pose(at))


def transform(time: float, parent: str, child: str, at: Sequence[float]) -> Message:
    """A ``TransformStamped``.

    Args:
        time: s.
        parent: Name of a frame.
        child: Name of the frame that is at the pose in it.
        at: x, y, theta, m and rad.

    Returns:
        The message.
    """
    x, y, theta = at
    placed = {"translation": vector(x, y), "rotation": _turn(theta)}
    return stamped(time, parent, child_frame_id=child, transform=placed)
