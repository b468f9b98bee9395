"""Two independent readers find in an MCAP file what the table says.

``mcap`` decodes it as it is; ``rosbags`` converts it to a ROS 2 bag in SQLite and
decodes that by its own code.
"""

from __future__ import annotations

import math
import re
import subprocess
import sys
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

import phonotaxis
from analysis.views.scene import compose, sensor_pose

#: Two robots, what rests, what moves, a room, and a name that no topic can bear.
SETTINGS = {
    "hearing": "ideal",
    "duration_s": 1.5,
    "room": {"size_m": [12.0, 10.0, 3.0]},
    "obstacles": [
        {"name": "box 1", "waypoints_m": [[2.0, 1.5]], "size_m": [0.4, 0.2]},
        {
            "name": "cart",
            "waypoints_m": [[3.0, -2.0], [1.0, -2.0]],
            "speed_m_s": 0.3,
            "size_m": [0.3, 0.3],
        },
    ],
}
Heard = dict[str, list[tuple[int, Any]]]


@pytest.fixture(scope="module")
def run() -> phonotaxis.RunResult:
    return phonotaxis.simulate(phonotaxis.load_scenario("two_followers", SETTINGS))


@pytest.fixture(scope="module")
def file(run, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path: Path = run.to_mcap(tmp_path_factory.mktemp("mcap") / "run.mcap")
    return path


def read_by_mcap(file: Path) -> Heard:
    heard: Heard = defaultdict(list)
    with file.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        for _, channel, message, decoded in reader.iter_decoded_messages():
            heard[channel.topic].append((message.log_time, decoded))
    return heard


def read_by_rosbags(file: Path) -> Heard:
    bag = file.with_suffix("")
    if not bag.exists():
        convert = Path(sys.executable).with_name("rosbags-convert")
        words = [str(convert), "--src", str(file), "--dst", str(bag)]
        subprocess.run([*words, "--dst-storage", "sqlite3"], check=True)
    assert [path.suffix for path in bag.iterdir() if "yaml" not in path.name] == [
        ".db3"
    ]
    heard: Heard = defaultdict(list)
    with AnyReader([bag]) as reader:
        for connection, time, data in reader.messages():
            decoded = reader.deserialize(data, connection.msgtype)
            heard[connection.topic].append((time, decoded))
    return heard


READERS = pytest.mark.parametrize("read", [read_by_mcap, read_by_rosbags])
Read = Callable[[Path], Heard]


def heading(q: Any) -> float:
    assert q.x == q.y == 0.0
    return math.atan2(2.0 * q.w * q.z, q.w * q.w - q.z * q.z)


def poses(heard: Heard, topic: str) -> np.ndarray:
    rows = []
    for time_ns, message in heard[topic]:
        stamp = message.header.stamp
        assert stamp.sec * 10**9 + stamp.nanosec == time_ns
        assert message.header.frame_id == "world"
        p = message.pose.position
        rows.append([1e-9 * time_ns, p.x, p.y, heading(message.pose.orientation)])
    return np.array(rows)


def assert_same_poses(found: np.ndarray, expected: np.ndarray) -> None:
    assert found.shape == expected.shape
    assert np.abs(found[:, :3] - expected[:, :3]).max() < 1e-9
    turned = np.exp(1j * found[:, 3]) - np.exp(1j * expected[:, 3])
    assert np.abs(turned).max() < 1e-9


@READERS
def test_poses_are_those_of_the_parquet(run, file: Path, tmp_path: Path, read: Read):
    import pandas as pd

    table = pd.read_parquet(run.to_parquet(tmp_path / "trajectory.parquet"))
    heard = read(file)
    ticks = [25_000_000 * k for k in range(61)]
    assert [time_ns for time_ns, _ in heard["/source/pose"]] == ticks
    for robot in run.robots:
        for topic, keys in (
            ("pose", ("p_WB_x", "p_WB_y", "theta_WB")),
            (
                "pose_estimated",
                ("p_WB_estimated_x", "p_WB_estimated_y", "theta_WB_estimated"),
            ),
            ("followed", ("p_WS_x", "p_WS_y", "theta_WS")),
        ):
            expected = table[["t", *(f"{robot}.{key}" for key in keys)]].to_numpy()
            assert len(expected) == 61
            assert_same_poses(poses(heard, f"/{robot}/{topic}"), expected)


@READERS
def test_numbers_are_those_of_the_table(run, file: Path, read: Read):
    heard = read(file)
    for name, own in run.robots.items():
        for key in (
            "attraction_x",
            "wheel_speed_left",
            "obstacle_speed_1",
            "feature_1",
        ):
            values = [message.data for _, message in heard[f"/{name}/{key}"]]
            assert values == own.columns[key].tolist()
        found = [m.twist.angular.z for _, m in heard[f"/{name}/velocity"]]
        assert found == own.columns["omega_WB"].tolist()
        seen = own.columns["target_valid"] > 0.5
        estimates = [
            [m.point.x, m.point.y] for _, m in heard[f"/{name}/source_estimate"]
        ]
        assert 0 < seen.sum() < len(seen)
        assert estimates == own.vector("p_WS_estimated").T[seen].tolist()


#: Columns that messages of other kinds tell.
OF_THEIR_KIND = {
    *("t", "p_WB_x", "p_WB_y", "theta_WB", "v_WB_x", "v_WB_y", "omega_WB"),
    *("p_WB_estimated_x", "p_WB_estimated_y", "theta_WB_estimated"),
    *("p_WS_x", "p_WS_y", "theta_WS", "p_WS_estimated_x", "p_WS_estimated_y"),
    *(f"echo_{k}" for k in (1, 2, 3)),
}


def test_every_other_column_has_a_topic(run, file: Path):
    heard = read_by_mcap(file)
    for name, own in run.robots.items():
        topics = {topic.removeprefix(f"/{name}/") for topic in heard}
        known = {
            key for key, values in own.columns.items() if np.isfinite(values).any()
        }
        assert len(known) > 40
        assert known - topics == OF_THEIR_KIND


@READERS
def test_ranges_are_infinite_without_an_echo(run, file: Path, read: Read):
    heard = read(file)
    echoes = 0
    for name, own in run.robots.items():
        for k in (1, 2, 3):
            messages = [message for _, message in heard[f"/{name}/range_{k}"]]
            echo = own.columns[f"echo_{k}"] > 0.5
            ranges = np.array([message.range for message in messages])
            assert (np.isinf(ranges) == ~echo).all()
            nearest = np.float32(own.columns[f"range_{k}"][echo])
            assert ranges[echo].tolist() == nearest.tolist()
            assert messages[0].field_of_view == pytest.approx(math.radians(30.0))
            assert messages[0].max_range == 3.0
            assert messages[0].header.frame_id == f"{name}/sensor_{k}"
            echoes += echo.sum()
    assert echoes > 0


def test_frames_lead_from_the_world_to_the_sensors(run, file: Path):
    """The chain world, base_link, sensor is the pose that pictures draw."""
    heard = read_by_mcap(file)
    name, own = next(iter(run.robots.items()))
    last = heard["/tf"][-1][1].transforms
    placed = {each.child_frame_id: each for each in last}

    def at(frame: str) -> tuple[float, float, float]:
        moved = placed[frame].transform
        turn = heading(moved.rotation)
        return moved.translation.x, moved.translation.y, turn

    for k in range(3):
        frame = f"{name}/sensor_{k + 1}"
        assert placed[frame].header.frame_id == f"{name}/base_link"
        found = compose(np.array(at(f"{name}/base_link")), np.array(at(frame)))
        expected = compose(own.poses("WB")[-1], sensor_pose(own.scenario.only, k))
        assert found[:2] == pytest.approx(expected[:2], abs=1e-12)
        assert math.remainder(found[2] - expected[2], math.tau) == pytest.approx(
            0.0, abs=1e-12
        )
    assert {"box_1", "cart"} <= placed.keys()
    assert len(heard["/box_1/pose"]) == 1
    assert len(heard["/cart/pose"]) == len(run.time)
    x = heard["/cart/pose"][-1][1].pose.position.x
    assert 2.5 < x < 3.0  # at most 0.3 m/s for 1.5 s, from rest


def test_markers_are_the_bodies_and_the_room(run, file: Path):
    ((_, message),) = read_by_mcap(file)["/markers"]
    groups: dict[str, list[Any]] = defaultdict(list)
    for marker in message.markers:
        groups[marker.ns].append(marker)
    assert {ns: len(group) for ns, group in groups.items()} == {
        "robots": 2, "sources": 1, "obstacles": 2, "room": 1
    }  # fmt: skip
    box = groups["obstacles"][0]
    assert (box.header.frame_id, box.type, box.frame_locked) == ("box_1", 1, True)
    assert (box.scale.x, box.scale.y) == (0.4, 0.2)
    points = np.array([[p.x, p.y, p.z] for p in groups["room"][0].points])
    lengths = np.linalg.norm(points[::2] - points[1::2], axis=1)
    assert sorted(lengths) == pytest.approx([3.0] * 4 + [10.0] * 4 + [12.0] * 4)
    assert [marker.id for marker in message.markers] == list(range(6))


def test_the_file_has_what_loaders_ask_for(file: Path):
    """Foxglove and PlotJuggler: encodings they parse, a summary, indexes, one time.

    PlotJuggler 3 takes the time of publication and refuses a file without statistics;
    4 goes by message indexes, and moves times that are outside of the statistics.
    """
    with file.open("rb") as stream:
        reader = make_reader(stream)
        assert reader.get_header().profile == "ros2"
        summary = reader.get_summary()
        times = [(m.log_time, m.publish_time) for _, _, m in reader.iter_messages()]
    assert summary is not None
    assert summary.statistics is not None
    encodings = {
        (channel.message_encoding, summary.schemas[channel.schema_id].encoding)
        for channel in summary.channels.values()
    }
    assert encodings == {("cdr", "ros2msg")}
    assert summary.chunk_indexes
    assert all(chunk.message_index_length > 0 for chunk in summary.chunk_indexes)
    assert all(logged == published for logged, published in times)
    counts = summary.statistics
    assert (counts.message_start_time, counts.message_end_time) == (0, 1_500_000_000)
    assert counts.message_count == len(times)


def test_the_same_run_gives_the_same_bytes(file: Path, tmp_path: Path):
    again = phonotaxis.simulate(phonotaxis.load_scenario("two_followers", SETTINGS))
    assert again.to_mcap(tmp_path / "again.mcap").read_bytes() == file.read_bytes()


def test_the_scenario_is_attached(run, file: Path, tmp_path: Path):
    with file.open("rb") as stream:
        (attached,) = make_reader(stream).iter_attachments()
    path = tmp_path / attached.name
    path.write_bytes(attached.data)
    assert phonotaxis.load_scenario(path) == run.full_scenario


def test_warnings_are_among_the_metadata(tmp_path: Path):
    settings = {"hearing": "ideal", "duration_s": 0.1, "guard": {}, "plant.friction": 1}
    run = phonotaxis.simulate(phonotaxis.load_scenario("u_trap", settings))
    with run.to_mcap(tmp_path / "run.mcap").open("rb") as stream:
        (found,) = make_reader(stream).iter_metadata()
    (warning,) = run.warnings
    assert found.metadata["warnings"] == str(warning)
    assert found.metadata["scenario"] == "u_trap"
    assert warning.field == "plant.friction"


def test_a_definition_needs_no_other_file(file: Path):
    """Each type that a definition names follows in it; the fields are ROS 2's."""
    with file.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    texts = {each.name: each.data.decode() for each in summary.schemas.values()}
    assert len(texts) == 7
    for text in texts.values():
        parts = set(re.findall(r"^MSG: (\S+)$", text, re.MULTILINE))
        assert set(re.findall(r"^(\w+/\w+)", text, re.MULTILINE)) == parts
    fields = texts["geometry_msgs/msg/PointStamped"].split("=" * 80)[0].split()
    assert fields == [
        "std_msgs/Header",
        "header",
        "geometry_msgs/Point",
        "point",
    ]


@pytest.mark.parametrize("name", ["odor_search", "odor_then_sound"])
def test_what_the_sink_of_a_search_has_heard_goes_along(name: str, tmp_path: Path):
    """It is no robot's log: every file must have it, and as it was logged."""
    import pandas as pd

    # A frame every 2 s from each robot, and the first after its gas sensors are warm.
    run = phonotaxis.simulate(
        phonotaxis.load_scenario(name, {"duration_s": 20.0}), engine="compiled"
    )
    assert run.world
    parquet = pd.read_parquet(run.to_parquet(tmp_path / "run.parquet"))
    text = pd.read_csv(run.to_csv(tmp_path / "run.csv"))
    heard = read_by_mcap(run.to_mcap(tmp_path / "run.mcap"))
    frames = 0.0
    for robot in run.robots:
        for field in ("frames", "function", "value", "age_s", "result"):
            logged = run.world[f"{robot}.{field}"]
            column = f"{robot}.sink_{field}" if run.several else f"sink_{field}"
            assert parquet[column].tolist() == logged.tolist()
            assert text[column].tolist() == logged.tolist()
            told = [message.data for _, message in heard[f"/{robot}/sink_{field}"]]
            assert told == logged.tolist()
        frames += run.world[f"{robot}.frames"][-1]
    assert frames > 0.0
