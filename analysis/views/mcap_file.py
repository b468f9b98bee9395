"""Writes a run as an MCAP file of ROS 2 messages, for Foxglove and PlotJuggler."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from importlib.util import find_spec
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.colors import to_rgb
from numpy.typing import NDArray

from analysis.report.palette import COLORS
from analysis.runs.recorded_run import SCENARIO_FILE, RecordedRun
from analysis.views.meshes import prism
from analysis.views.scene import (
    BODY_HEIGHT_M,
    ROBOT_HEIGHT_M,
    Obstacle,
    RobotBody,
    SourceBody,
    Thing,
    scene_bodies,
    sensor_pose,
)
from diagrams import dump_scenario
from diagrams.scenario.participants import HasRangeSensors, Robot
from diagrams.scenario.warnings.warnings_of import warnings_of
from systems.framework.input_error import InputError
from systems.sound.parameters import RoomParameters
from systems.world.shapes import Shape

#: A message, as its fields by name.
Message = dict[str, Any]
#: Name of the world frame W.
WORLD_FRAME = "world"
#: Constants of ``visualization_msgs/Marker``.
_CUBE, _CYLINDER, _LINE_LIST, _TRIANGLES, _ADD = 1, 3, 5, 11, 0
#: Width of the edges of a room, m.
_EDGE_M = 0.03
_PACKAGES = ("mcap", "mcap_ros2", "rosbags")
#: Columns of a run's table that form a pose, by topic. Each pose becomes one message
#: instead of three messages with single numbers.
_POSES = {
    "pose": ("p_WB_x", "p_WB_y", "theta_WB"),
    "pose_estimated": ("p_WB_estimated_x", "p_WB_estimated_y", "theta_WB_estimated"),
    "followed": ("p_WS_x", "p_WS_y", "theta_WS"),
}
_VELOCITY = ("v_WB_x", "v_WB_y", "omega_WB")
_ESTIMATE = ("p_WS_estimated_x", "p_WS_estimated_y", "target_valid")
#: A message to write: topic, type of the message, and message.
_Entry = tuple[str, str, Message]


def require_mcap() -> None:
    """Checks that the packages for MCAP files are installed.

    If a package is not installed, an InputError explains how to install it.
    """
    missing = [name for name in _PACKAGES if find_spec(name) is None]
    if missing:
        raise InputError(
            "mcap",
            "needs the packages mcap, mcap-ros2-support and rosbags; install them "
            "with pip install 'phonotaxis[export]'",
        )


def write_mcap(run: RecordedRun, path: Path) -> None:
    """Writes a run as an MCAP file. docs/exports.md lists the topics of the file.

    The times in the file start at 0, as in the run. Two files of the same run have
    equal bytes. The function raises an InputError if a package is not installed.
    """
    require_mcap()
    from mcap_ros2.writer import Writer

    content = BytesIO()
    with Writer(content) as writer:
        _write(writer, run)
    path.write_bytes(content.getvalue())


def _write(writer: Any, run: RecordedRun) -> None:
    from rosbags.typesys import Stores, get_typestore

    known, schemas = get_typestore(Stores.ROS2_JAZZY), {}
    scenario = run.scenario
    about = {
        "scenario": scenario.name,
        "law": scenario.law_names,
        "seed": str(scenario.seed),
        "warnings": "\n".join(map(str, warnings_of(scenario))),
    }
    writer.add_metadata("phonotaxis", about)
    text = dump_scenario(scenario).encode()
    writer.add_attachment(0, 0, SCENARIO_FILE, "application/yaml", text)
    for tick, entries in enumerate(_ticks(run)):
        time_ns = round(1e9 * float(run.time[tick]))
        for topic, kind, message in entries:
            if kind not in schemas:
                name = kind.replace("/", "/msg/")
                definition, _ = known.generate_msgdef(name, ros_version=2)
                schemas[kind] = writer.register_msgdef(name, definition)
            writer.write_message(topic, schemas[kind], message, time_ns, sequence=tick)


def _ticks(run: RecordedRun) -> Iterator[Iterable[_Entry]]:
    """Yields the messages of each tick (control period)."""
    scenario = run.scenario
    robots = {
        name: np.column_stack([own[key] for key in _POSES["pose"]])
        for name, own in run.robots.items()
    }
    bodies = scene_bodies(scenario, run.time, robots)
    names = _ros_names(bodies)
    for tick, time in enumerate(run.time.tolist()):
        entries: list[_Entry] = []
        frames: list[Message] = []
        if tick == 0:
            markers = {"markers": _body_markers(bodies, scenario.room, names)}
            entries.append(("/markers", "visualization_msgs/MarkerArray", markers))
        for name, own in run.robots.items():
            robot = scenario.robots[name]
            frames += _robot_frames(names[name], own, robot, tick, time)
            entries += _robot_entries(names[name], own, robot, tick, time)
        for name, body in bodies.items():
            if name in robots:
                continue
            at = body.pose(tick).tolist()
            frames.append(_transform(time, WORLD_FRAME, names[name], at))
            # An obstacle at rest has a single pose.
            if tick < len(body.poses):
                topic, message = f"/{names[name]}/pose", _stamped_pose(time, at)
                entries.append((topic, "geometry_msgs/PoseStamped", message))
        entries.append(("/tf", "tf2_msgs/TFMessage", {"transforms": frames}))
        yield entries


def _ros_names(names: Iterable[str]) -> dict[str, str]:
    """Returns a unique ROS name for each name.

    A ROS name contains only letters, digits and underscores.
    """
    found: dict[str, str] = {}
    for name in names:
        plain = _plain(name)
        while plain in found.values():
            plain += "_"
        found[name] = plain
    return found


def _plain(name: str) -> str:
    plain = re.sub(r"[^A-Za-z0-9_]", "_", name)
    return plain if plain[:1].isalpha() else f"_{plain}"


def _sensors(robot: Robot, own: Mapping[str, NDArray[np.float64]]) -> list[int]:
    """Returns the indices of the range sensors whose readings are in the table."""
    count = robot.ultrasonic.count if isinstance(robot, HasRangeSensors) else 0
    return [k for k in range(count) if f"range_{k + 1}" in own]


def _robot_frames(
    name: str,
    own: Mapping[str, NDArray[np.float64]],
    robot: Robot,
    tick: int,
    time: float,
) -> Iterator[Message]:
    """Yields the transforms of the frames of the robot, of P, and of each range sensor.

    The frame of the robot is B, with its origin at the axle. The x axis of a sensor's
    frame is the axis of the sensor's cone.
    """
    base, ahead = f"{name}/base_link", robot.robot.control_point_m
    at = [float(own[key][tick]) for key in _POSES["pose"]]
    yield _transform(time, WORLD_FRAME, base, at)
    yield _transform(time, base, f"{name}/control_point", [ahead, 0.0, 0.0])
    for k in _sensors(robot, own):
        pose_BU = sensor_pose(robot, k).tolist()
        yield _transform(time, base, f"{name}/sensor_{k + 1}", pose_BU)


def _robot_entries(
    name: str,
    own: Mapping[str, NDArray[np.float64]],
    robot: Robot,
    tick: int,
    time: float,
) -> Iterator[_Entry]:
    """Yields all messages of one robot at a tick, from the columns of its table."""
    told = {"t"}
    for topic, keys in _POSES.items():
        told.update(keys)
        at = [float(own[key][tick]) for key in keys]
        yield f"/{name}/{topic}", "geometry_msgs/PoseStamped", _stamped_pose(time, at)
    told.update(_VELOCITY)
    vx, vy, omega = (float(own[key][tick]) for key in _VELOCITY)
    twist = {"linear": _vector(vx, vy), "angular": _vector(z=omega)}
    message = _stamped(time, WORLD_FRAME, twist=twist)
    yield f"/{name}/velocity", "geometry_msgs/TwistStamped", message
    if all(key in own for key in _ESTIMATE):
        told.update(_ESTIMATE[:2])
        x, y, valid = (float(own[key][tick]) for key in _ESTIMATE)
        if valid > 0.5:
            message = _stamped(time, WORLD_FRAME, point=_vector(x, y))
            yield f"/{name}/source_estimate", "geometry_msgs/PointStamped", message
    for k in _sensors(robot, own):
        column = f"range_{k + 1}"
        told.update((column, f"echo_{k + 1}"))
        echo = own[f"echo_{k + 1}"][tick] > 0.5
        distance = float(own[column][tick]) if echo else math.inf
        message = _range(name, k, robot, time, distance)
        yield f"/{name}/{column}", "sensor_msgs/Range", message
    for key, values in own.items():
        value = float(values[tick])
        if key not in told and math.isfinite(value):
            yield f"/{name}/{_plain(key)}", "std_msgs/Float64", {"data": value}


def _range(name: str, k: int, robot: Robot, time: float, distance: float) -> Message:
    """Returns a ``Range`` message of sensor ``k``.

    ``distance`` is the measured range, m. It must be infinite if there is no echo.
    """
    assert isinstance(robot, HasRangeSensors)
    sensor = robot.ultrasonic.sensors[k]
    return _stamped(
        time,
        f"{name}/sensor_{k + 1}",
        radiation_type=0,
        field_of_view=2.0 * math.radians(sensor.beam_half_angle_deg),
        min_range=sensor.minimum_range_m,
        max_range=sensor.maximum_range_m,
        range=distance,
        variance=sensor.noise_m**2,
    )


def _body_markers(
    bodies: Mapping[str, Thing], room: RoomParameters | None, names: Mapping[str, str]
) -> list[Message]:
    """Returns ``Marker`` messages: one per body, in the frame of the body.

    If there is a room, one more message has the edges of the room.
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
            case Obstacle(shape, height):
                markers.append(_solid(frame, shape, height))
    if room is not None:
        markers.append(_edges(room))
    return [{**marker, "id": number} for number, marker in enumerate(markers)]


def _box(
    frame: str, group: str, size: tuple[float, float, float], color: str
) -> Message:
    at = _pose((0.0, 0.0, 0.0), 0.5 * size[2])
    return _marker(frame, group, _CUBE, color, at, _vector(*size))


def _solid(frame: str, shape: Shape, height: float) -> Message:
    """Returns a ``Marker`` message of an obstacle with a height, m."""
    if shape.centered:
        length, width, radius = shape.rectangles[0, 3:].tolist()
        if radius == 0.0:
            return _box(frame, "obstacles", (length, width, height), "obstacle")
        if length == width == 0.0:
            at, size = _pose((0.0, 0.0, 0.0), 0.5 * height), 2.0 * radius
            scale = _vector(size, size, height)
            return _marker(frame, "obstacles", _CYLINDER, "obstacle", at, scale)
    meshes = [prism(outline, height) for outline in shape.outlines]
    corners = [mesh.vertices[:, mesh.faces.T.ravel()].T for mesh in meshes]
    points = [_vector(*point) for point in np.concatenate(corners).tolist()]
    at, scale = _pose((0.0, 0.0, 0.0)), _vector(1.0, 1.0, 1.0)
    return _marker(frame, "obstacles", _TRIANGLES, "obstacle", at, scale, points=points)


def _edges(room: RoomParameters) -> Message:
    """Returns a ``Marker`` message with the edges of a room, as pairs of end points."""
    low = np.array([*room.corner, 0.0])
    corners = [low + np.array(room.size_m) * k for k in np.ndindex(2, 2, 2)]
    ends = [
        _vector(*end.tolist())
        for a in range(8)
        for b in range(a)
        if (a ^ b).bit_count() == 1
        for end in (corners[a], corners[b])
    ]
    at, wide = _pose((0.0, 0.0, 0.0)), _vector(_EDGE_M)
    return _marker(WORLD_FRAME, "room", _LINE_LIST, "empty", at, wide, points=ends)


def _marker(
    frame: str,
    group: str,
    kind: int,
    color: str,
    at: Message,
    scale: Message,
    **others: Any,
) -> Message:
    red, green, blue = to_rgb(COLORS[color])
    return _stamped(
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


def _stamped(time: float, frame: str, **fields: Any) -> Message:
    """Returns a message with a header and ``fields``.

    The header has the time, s, and the name of the frame of the message.
    """
    sec, nanosec = divmod(round(1e9 * time), 10**9)
    stamp = {"sec": sec, "nanosec": nanosec}
    return {"header": {"stamp": stamp, "frame_id": frame}, **fields}


def _vector(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Message:
    """Returns a ``Vector3`` or ``Point`` message. The unit of the values is kept."""
    return {"x": x, "y": y, "z": z}


def _turn(theta: float) -> Message:
    """Returns the quaternion of a rotation about z by an angle, rad."""
    return {**_vector(z=math.sin(0.5 * theta)), "w": math.cos(0.5 * theta)}


def _pose(at: Sequence[float], height_m: float = 0.0) -> Message:
    """Returns a ``Pose`` message of a pose (x, y, theta), m and rad."""
    x, y, theta = at
    return {"position": _vector(x, y, height_m), "orientation": _turn(theta)}


def _stamped_pose(time: float, at: Sequence[float]) -> Message:
    """Returns a ``PoseStamped`` message of a pose (x, y, theta) in W, m and rad."""
    return _stamped(time, WORLD_FRAME, pose=_pose(at))


def _transform(time: float, parent: str, child: str, at: Sequence[float]) -> Message:
    """Returns a ``TransformStamped`` message from a frame ``parent`` to ``child``.

    ``at`` is the pose (x, y, theta) of ``child`` in ``parent``, m and rad.
    """
    x, y, theta = at
    placed = {"translation": _vector(x, y), "rotation": _turn(theta)}
    return _stamped(time, parent, child_frame_id=child, transform=placed)
