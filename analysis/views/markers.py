"""Converts bodies and walls to ROS 2 markers, each in the frame of its body."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from matplotlib.colors import to_rgb

from analysis.reporting.palette import COLOURS
from analysis.views.ros2_values import WORLD_FRAME, Message, pose, stamped, vector
from diagrams import Scenario
from systems.sound.parameters import RoomParameters

#: Constants of ``visualization_msgs/Marker``.
_CUBE, _LINE_LIST, _ADD = 1, 5, 0
#: Heights of the robots and of other bodies, m. The model contains no heights, so these
#: values are only for the display.
_ROBOT_M, _BODY_M = 0.16, 0.35
#: Width of the edges of a room, m.
_EDGE_M = 0.03


def body_markers(scenario: Scenario, names: Mapping[str, str]) -> list[Message]:
    """Returns markers of the robots, sources, obstacles and walls.

    Each marker moves with its frame.

    Args:
        scenario: Scenario that contains the bodies.
        names: Name of the frame of each robot, source and obstacle, by the name of the
            body.

    Returns:
        One ``Marker`` message per body, and one for the walls.
    """
    markers = [*_boxes(scenario, names)]
    if scenario.room is not None:
        markers.append(_edges(scenario.room))
    return [{**marker, "id": number} for number, marker in enumerate(markers)]


def _boxes(scenario: Scenario, names: Mapping[str, str]) -> Iterator[Message]:
    for name, robot in scenario.robots.items():
        size, frame = (robot.robot.length_m, robot.robot.width_m), names[name]
        yield _box(f"{frame}/base_link", "robots", size, _ROBOT_M, "robot")
    for name, source in scenario.sources.items():
        if source.body:
            size = source.length_m, source.width_m
            yield _box(names[name], "sources", size, _BODY_M, "source")
    for obstacle in scenario.obstacles:
        frame = names[obstacle.name]
        yield _box(frame, "obstacles", obstacle.size_m, _BODY_M, "obstacle")


def _box(
    frame: str, group: str, size: tuple[float, float], height: float, colour: str
) -> Message:
    at = pose((0.0, 0.0, 0.0), 0.5 * height)
    return _marker(frame, group, _CUBE, colour, at, vector(*size, height))


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
