"""Writes a run as an MCAP file of ROS 2 messages, for Foxglove and PlotJuggler."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from importlib.util import find_spec
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.runs.recorded_run import SCENARIO_FILE, RecordedRun
from analysis.views.markers import body_markers
from analysis.views.ros2_values import (
    WORLD_FRAME,
    Message,
    stamped,
    stamped_pose,
    transform,
    vector,
)
from analysis.views.scene import scene_bodies, sensor_pose
from diagrams import dump_scenario
from diagrams.scenario.participants import HasRangeSensors, Robot
from diagrams.scenario.warnings.warnings_of import warnings_of
from systems.framework.input_error import InputError

_PACKAGES = ("mcap", "mcap_ros2", "rosbags")
#: Columns of poses, by topic. They become pose messages instead of single numbers.
_POSES = {
    "pose": ("p_WB_x", "p_WB_y", "theta_WB"),
    "pose_estimated": ("p_WB_estimated_x", "p_WB_estimated_y", "theta_WB_estimated"),
    "followed": ("p_WS_x", "p_WS_y", "theta_WS"),
}
_VELOCITY = ("v_WB_x", "v_WB_y", "omega_WB")
_ESTIMATE = ("p_WS_estimated_x", "p_WS_estimated_y", "target_valid")
#: Topic, type of the message, and message.
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
    equal bytes. InputError if a package is not installed.
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
            markers = {"markers": body_markers(bodies, scenario.room, names)}
            entries.append(("/markers", "visualization_msgs/MarkerArray", markers))
        for name, own in run.robots.items():
            robot = scenario.robots[name]
            frames += _robot_frames(names[name], own, robot, tick, time)
            entries += _robot_entries(names[name], own, robot, tick, time)
        for name, body in bodies.items():
            if name in robots:
                continue
            at = body.pose(tick).tolist()
            frames.append(transform(time, WORLD_FRAME, names[name], at))
            # An obstacle at rest has a single pose.
            if tick < len(body.poses):
                topic, message = f"/{names[name]}/pose", stamped_pose(time, at)
                entries.append((topic, "geometry_msgs/PoseStamped", message))
        entries.append(("/tf", "tf2_msgs/TFMessage", {"transforms": frames}))
        yield entries


def _ros_names(names: Iterable[str]) -> dict[str, str]:
    """Returns valid and unique ROS names: only letters, digits and underscores."""
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


def _sensors(robot: Robot) -> int:
    return robot.ultrasonic.count if isinstance(robot, HasRangeSensors) else 0


def _robot_frames(
    name: str,
    own: Mapping[str, NDArray[np.float64]],
    robot: Robot,
    tick: int,
    time: float,
) -> Iterator[Message]:
    """Yields the transforms of the frames of one robot.

    The frames are the robot frame B, a frame at the control point P, and a frame for
    each range sensor. The x axis of a sensor's frame is the axis of its cone.
    """
    base, ahead = f"{name}/base_link", robot.robot.control_point_m
    at = [float(own[key][tick]) for key in _POSES["pose"]]
    yield transform(time, WORLD_FRAME, base, at)
    yield transform(time, base, f"{name}/control_point", [ahead, 0.0, 0.0])
    if not isinstance(robot, HasRangeSensors):
        return
    for k in range(robot.ultrasonic.count):
        if f"range_{k + 1}" in own:
            pose_BU = sensor_pose(robot, k).tolist()
            yield transform(time, base, f"{name}/sensor_{k + 1}", pose_BU)


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
        yield f"/{name}/{topic}", "geometry_msgs/PoseStamped", stamped_pose(time, at)
    told.update(_VELOCITY)
    vx, vy, omega = (float(own[key][tick]) for key in _VELOCITY)
    twist = {"linear": vector(vx, vy), "angular": vector(z=omega)}
    message = stamped(time, WORLD_FRAME, twist=twist)
    yield f"/{name}/velocity", "geometry_msgs/TwistStamped", message
    if all(key in own for key in _ESTIMATE):
        told.update(_ESTIMATE[:2])
        x, y, valid = (float(own[key][tick]) for key in _ESTIMATE)
        if valid > 0.5:
            message = stamped(time, WORLD_FRAME, point=vector(x, y))
            yield f"/{name}/source_estimate", "geometry_msgs/PointStamped", message
    for k in range(1, _sensors(robot) + 1):
        if f"range_{k}" in own:
            told.update((f"range_{k}", f"echo_{k}"))
            echo = own[f"echo_{k}"][tick] > 0.5
            distance = float(own[f"range_{k}"][tick]) if echo else math.inf
            message = _range(name, k, robot, time, distance)
            yield f"/{name}/range_{k}", "sensor_msgs/Range", message
    for key, values in own.items():
        value = float(values[tick])
        if key not in told and math.isfinite(value):
            yield f"/{name}/{_plain(key)}", "std_msgs/Float64", {"data": value}


def _range(name: str, k: int, robot: Robot, time: float, distance: float) -> Message:
    """Returns a range message. Without an echo, the range is infinite."""
    assert isinstance(robot, HasRangeSensors)
    sensor = robot.ultrasonic.sensors[k - 1]
    return stamped(
        time,
        f"{name}/sensor_{k}",
        radiation_type=0,
        field_of_view=2.0 * math.radians(sensor.beam_half_angle_deg),
        min_range=sensor.minimum_range_m,
        max_range=sensor.maximum_range_m,
        range=distance,
        variance=sensor.noise_m**2,
    )
