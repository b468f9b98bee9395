"""Converts the bodies of a scene to ROS 2 markers, each in the frame of its body."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.colors import to_rgb

from analysis.reporting.palette import COLOURS
from analysis.views.ros2_values import WORLD_FRAME, Message, pose, stamped, vector
from analysis.views.scene import (
    BODY_HEIGHT_M,
    ROBOT_HEIGHT_M,
    Box,
    RobotBody,
    SourceBody,
    Thing,
)
from systems.sound.parameters import RoomParameters

#: Constants of ``visualization_msgs/Marker``.
_CUBE, _LINE_LIST, _ADD = 1, 5, 0
#: Width of the edges of a room, m.
_EDGE_M = 0.03


def body_markers(
    bodies: Mapping[str, Thing], room: RoomParameters | None, names: Mapping[str, str]
) -> list[Message]:
    """Returns one ``Marker`` message per robot, source and obstacle, and one for walls.

    Each marker moves with its frame. ``names`` has the name of the frame of each body.
    """
    markers = []
    for name, body in bodies.items():
        frame = names[name]
        match body.shape:
            case RobotBody(parameters=own):
                size = own.length_m, own.width_m, ROBOT_HEIGHT_M
                markers.append(_box(f"{frame}/base_link", "robots", size, "robot"))
            case SourceBody(length, width, is_body=True):
                size = length, width, BODY_HEIGHT_M
                markers.append(_box(frame, "sources", size, "source"))
            case Box() as size:
                markers.append(_box(frame, "obstacles", size, "obstacle"))
    if room is not None:
        markers.append(_edges(room))
    return [{**marker, "id": number} for number, marker in enumerate(markers)]


def _box(
    frame: str, group: str, size: tuple[float, float, float], colour: str
) -> Message:
    at = pose((0.0, 0.0, 0.0), 0.5 * size[2])
    return _marker(frame, group, _CUBE, colour, at, vector(*size))


def _edges(room: RoomParameters) -> Message:
    """Returns a marker with the edges of a room, as pairs of end points."""
    low = np.array([*room.corner, 0.0])
    corners = [low + np.array(room.size_m) * k for k in np.ndindex(2, 2, 2)]
    ends = [
        vector(*end.tolist())
        for a in range(8)
        for b in range(a)
        if (a ^ b).bit_count() == 1
        for end in (corners[a], corners[b])
    ]
    at, wide = pose((0.0, 0.0, 0.0)), vector(_EDGE_M)
    return _marker(WORLD_FRAME, "room", _LINE_LIST, "empty", at, wide, points=ends)


def _marker(
    frame: str,
    group: str,
    kind: int,
    colour: str,
    at: Message,
    scale: Message,
    **others: Any,
) -> Message:
    red, green, blue = to_rgb(COLOURS[colour])
    return stamped(
        0.0,
        frame,
        ns=group,
        type=kind,
        action=_ADD,
        pose=at,
        scale=scale,
        color={"r": red, "g": green, "b": blue, "a": 0.8},
        frame_locked=True,
        **others,
    )
