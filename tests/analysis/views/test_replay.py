"""What the replay records is the run; what it writes needs nothing else."""

from __future__ import annotations

import contextlib
import logging
import math
import re
import socket
from dataclasses import dataclass, field, replace
from typing import Any, cast

import numpy as np
import pytest

from analysis.runs.guarded_motion import guarded_motion
from analysis.runs.known_space import known_space
from analysis.views.framing import floor_rectangle
from analysis.views.overlays import overlays
from analysis.views.replay import (
    RINGS_M,
    frame_times,
    known_times,
    record,
    ring_at,
    wheel_angles,
    write_replay,
)
from analysis.views.scene import make_scene
from diagrams import load_scenario, simulate

FRAME_S = 1.0 / 32.0


@dataclass
class Recorder:
    """Takes down what Meshcat is told."""

    transforms: dict[Any, Any] = field(default_factory=dict)
    properties: dict[Any, Any] = field(default_factory=dict)
    meshes: dict[Any, Any] = field(default_factory=dict)
    shapes: dict[Any, Any] = field(default_factory=dict)

    def SetTransform(self, path, X_ParentPath, time_in_recording=None):
        track = self.transforms.setdefault(path, [])
        track.append((time_in_recording, X_ParentPath))

    def SetProperty(self, path, property, value, time_in_recording=None):  # noqa: A002
        track = self.properties.setdefault((path, property), [])
        track.append((time_in_recording, value))

    def SetObject(self, path, shape, rgba):
        self.shapes[path] = shape

    def SetTriangleMesh(self, path, vertices, faces, rgba):
        self.meshes[path] = np.array(vertices)

    def visible(self, path, time):
        """Whether an object is seen at a time: the last switch counts."""
        switches = self.properties[path, "visible"]
        return [state for at, state in switches if at <= time + 1e-9][-1]


def recording(run):
    recorder, scene = Recorder(), make_scene(run)
    layers = [*scene.layers, *overlays(scene, frame_times(run))]
    things = [thing for layer in layers for thing in layer.things]
    record(cast("Any", recorder), scene, things)
    return recorder


@pytest.fixture(scope="module")
def recorded(crossing_run):
    return recording(crossing_run)


def _heading(X):
    return math.atan2(X.rotation().matrix()[1, 0], X.rotation().matrix()[0, 0])


@pytest.mark.parametrize(("path", "body"), [("robot", "WB"), ("source", "WS")])
def test_bodies_are_where_the_columns_say(crossing_run, recorded, path, body):
    columns, track = crossing_run.columns, recorded.transforms[path]
    assert len(track) == 16 * 32 + 1
    for time, X in track[::16]:
        # Every half second is a frame and a tick.
        tick = round(time / 0.025)
        place = [columns[f"p_{body}_x"][tick], columns[f"p_{body}_y"][tick], 0.0]
        np.testing.assert_allclose(X.translation(), place, atol=1e-9)
        turned = _heading(X) - columns[f"theta_{body}"][tick]
        assert math.remainder(turned, math.tau) == pytest.approx(0.0, abs=1e-9)


def cart_way(time):
    """4 m at 0.3 m/s, with 1 m/s^2 at the start and the end."""
    left = max(4.0 / 0.3 + 0.3 - time, 0.0)
    if time < 0.3:
        return 0.5 * time**2
    return 4.0 - 0.5 * left**2 if left < 0.3 else 0.3 * time - 0.045


def test_a_moving_obstacle_moves_and_a_resting_one_rests(recorded):
    ((time, _),) = recorded.transforms["obstacles/box"]
    assert time is None
    for time, X in recorded.transforms["obstacles/cart"][::32]:
        y = -2.0 + cart_way(time)
        assert X.translation()[:2] == pytest.approx([3.0, y])


@pytest.mark.parametrize("number", [1, 2, 3])
def test_cones_change_their_look_with_the_echo(crossing_run, recorded, number):
    echo = crossing_run.columns[f"echo_{number}"] > 0.5
    assert 0 < np.count_nonzero(echo) < len(echo)
    cone = f"robot/cone_{number}"
    for time, seen in zip(crossing_run.time, echo, strict=True):
        assert recorded.visible(f"{cone}/echo", time) == seen
        assert recorded.visible(f"{cone}/empty", time) != seen


def test_ideal_sensing_records_no_cones(ideal_run):
    recorder = recording(ideal_run)
    assert not [path for path, _ in recorder.properties if "cone" in path]


def test_one_ring_is_seen_while_the_source_sounds_and_none_else(recorded):
    paths = [f"source/rings/{k}" for k in range(1, len(RINGS_M) + 1)]
    for time in np.arange(0.015, 15.9, 0.03125):
        seen = sum(recorded.visible(path, time) for path in paths)
        assert seen == (1 if math.fmod(time, 2.0) < 0.5 else 0)


def test_the_ring_grows():
    times = np.arange(0.0, 0.3125, 0.0625) + 0.01
    assert [ring_at(float(t), [(0.0, 0.5)]) for t in times] == [0, 1, 2, 3, 4]
    assert ring_at(0.5, [(0.0, 0.5)]) is None


def test_the_trail_appears_piece_after_piece(crossing_run, recorded):
    columns = crossing_run.columns
    pieces = [path for path in recorded.meshes if path.startswith("trail/robot/")]
    assert len(pieces) == 32
    for path in pieces:
        end = 0.5 * (1 + int(path.rsplit("/", 1)[1]))
        assert not recorded.visible(path, end - FRAME_S)
        assert recorded.visible(path, end)
        tick = round(end / 0.025)
        last = recorded.meshes[path][:2, [20, 41]].mean(axis=1)
        place = [columns["p_WP_x"][tick], columns["p_WP_y"][tick]]
        np.testing.assert_allclose(last, place, atol=1e-9)


def test_the_ball_is_where_the_source_is_taken_to_be(crossing_run, recorded):
    columns = crossing_run.columns
    track = recorded.transforms["estimate"]
    valid = columns["target_valid"] > 0.5
    for tick in np.flatnonzero(valid)[::7]:
        time = crossing_run.time[tick]
        _, X = [entry for entry in track if entry[0] <= time + 1e-9][-1]
        place = [columns["p_WS_estimated_x"][tick], columns["p_WS_estimated_y"][tick]]
        np.testing.assert_allclose(X.translation()[:2], place, atol=1e-4)
        assert recorded.visible("estimate", time)


def _driven(run, x, y, theta):
    columns = dict(run.columns)
    columns |= {"p_WB_x": x, "p_WB_y": y, "theta_WB": theta}
    return replace(run, columns=columns)


def _angles(run):
    return wheel_angles(run.scenario.only.robot, run.poses("WB"))


def test_wheels_that_roll_a_meter_turn_by_a_meter_over_their_radius(ideal_run):
    part = np.linspace(0.0, 1.0, len(ideal_run.time))
    heading = np.full_like(part, 0.7)
    straight = _driven(ideal_run, part * math.cos(0.7), part * math.sin(0.7), heading)
    for angles in _angles(straight).values():
        assert angles[-1] == pytest.approx(1.0 / 0.06)


def test_a_turn_on_the_spot_turns_the_wheels_against_each_other(ideal_run):
    part = np.linspace(0.0, 1.0, len(ideal_run.time))
    # Through pi, where a heading may jump by a turn.
    heading = (3.0 + part + math.pi) % math.tau - math.pi
    angles = _angles(_driven(ideal_run, 0.0 * part, 0.0 * part, heading))
    assert angles["right"][-1] == pytest.approx(0.5 * 0.41 / 0.06)
    assert angles["left"][-1] == pytest.approx(-0.5 * 0.41 / 0.06)


def test_the_robot_has_its_bar_and_three_microphones(recorded):
    assert recorded.shapes["robot/bar"].depth() == pytest.approx(0.82)
    places = [recorded.transforms[f"robot/microphone_{k}"][0][1] for k in (1, 2, 3)]
    np.testing.assert_allclose(
        [X.translation()[:2] for X in places],
        [[0.175, 0.4], [0.175, 0.0], [0.175, -0.4]],
        atol=1e-12,
    )
    assert sum("/echo" in path for path in recorded.shapes) == 3
    assert sum("/empty" in path for path in recorded.shapes) == 3


def test_wheels_turn_forward_when_the_robot_drives_forward(recorded, crossing_run):
    angles = _angles(crossing_run)["left"]
    for time, X in recorded.transforms["robot/left/wheel"][::16]:
        turned = _heading(X) - angles[round(time / 0.025)]
        assert math.remainder(turned, math.tau) == pytest.approx(0.0, abs=1e-9)
    # The wheel's own axis is y of B: its top moves along +x of B.
    X_BL = recorded.transforms["robot/left"][0][1]
    axis = X_BL.rotation().matrix()[:, 2]
    top = np.array([0.0, 0.0, 0.06])
    assert np.cross(axis, top)[0] == pytest.approx(0.06)


def test_the_page_is_whole_small_and_told_nobody(ideal_run, tmp_path, capfd):
    path, logger = tmp_path / "replay.html", logging.getLogger("drake")
    level = logger.level
    write_replay(ideal_run, path)
    assert capfd.readouterr() == ("", "")
    assert logger.level == level
    page = path.read_text()
    assert "<title>default, law active: completed - replay</title>" in page
    assert len(page) < 4e6
    fetched = re.findall(r"<(?:script|link|img)[^>]+(?:src|href)=\"(?!data:)", page)
    assert fetched == []


def test_a_port_that_is_in_use_is_no_hindrance(ideal_run, tmp_path):
    with socket.socket() as taken:
        # Meshcat looks from 7000 on; where this fails, somebody else holds it.
        with contextlib.suppress(OSError):
            taken.bind(("localhost", 7000))
            taken.listen()
        write_replay(ideal_run, tmp_path / "replay.html")
    assert (tmp_path / "replay.html").stat().st_size > 2e6


def test_the_title_is_escaped(ideal_run, tmp_path):
    scenario = ideal_run.scenario.model_copy(update={"name": "<b> & \\1"})
    write_replay(replace(ideal_run, scenario=scenario), tmp_path / "replay.html")
    page = (tmp_path / "replay.html").read_text()
    assert "<title>&lt;b&gt; &amp; \\1, law active" in page


def test_a_run_of_one_tick_has_a_replay(shortest_run):
    recorder = recording(shortest_run)
    assert "robot" not in recorder.transforms  # it is at the origin
    assert "robot/body" in recorder.shapes
    assert not [path for path in recorder.meshes if path.startswith("trail")]


@pytest.fixture(scope="module")
def guarded(guarded_run):
    return recording(guarded_run)


def _on_show(recorder, prefix, time):
    """(m, 4) rectangles of the meshes that are seen at a time."""
    paths = [path for path in recorder.meshes if path.startswith(prefix)]
    assert paths
    corners = [
        recorder.meshes[path][:2].reshape(2, -1, 4)
        for path in paths
        if recorder.visible(path, time)
    ]
    x, y = np.concatenate(corners, axis=1)
    return np.column_stack([x.min(axis=1), x.max(axis=1), y.min(axis=1), y.max(axis=1)])


@pytest.mark.parametrize("time", [1.0, 2.5, 5.0])
def test_the_floor_shows_what_the_robot_knows(guarded_run, guarded, time):
    """The known cells on the floor, by their area and their middles."""
    known = known_space(guarded_run, time)
    assert known is not None
    x_low, x_high, y_low, y_high = floor_rectangle(guarded_run)
    rectangles = _on_show(guarded, "known/robot/free", time)
    middles = known.middles(known.free[0])
    x, y = middles.T
    on_floor = (x > x_low) & (x < x_high) & (y > y_low) & (y < y_high)
    covered = np.zeros(len(middles), dtype=int)
    for x_0, x_1, y_0, y_1 in rectangles:
        covered += (x > x_0) & (x < x_1) & (y > y_0) & (y < y_1)
    assert np.array_equal(covered, on_floor * 1)
    area = np.sum(np.diff(rectangles[:, :2]) * np.diff(rectangles[:, 2:]))
    assert area == pytest.approx(0.05**2 * np.count_nonzero(on_floor))


def test_dots_are_where_echoes_came_from(guarded_run, guarded):
    known = known_space(guarded_run, 5.0)
    assert known is not None
    dots = _on_show(guarded, "known/robot/echoes", 5.0)
    middles = np.column_stack([dots[:, :2].mean(axis=1), dots[:, 2:].mean(axis=1)])
    x_low, x_high, y_low, y_high = floor_rectangle(guarded_run)
    wanted = known.middles(known.hits[0] > 0.0)
    x, y = wanted.T
    inside = (x > x_low) & (x < x_high) & (y > y_low) & (y < y_high)
    ours = {tuple(place) for place in np.round(middles, 6)}
    assert ours == {tuple(place) for place in np.round(wanted[inside], 6)}


def test_the_guards_outline_is_where_the_robot_could_rest(guarded_run, guarded):
    motion = guarded_motion(guarded_run)
    assert motion is not None
    for time, X in guarded.transforms["guard/robot"][::16]:
        tick = round(time / 0.025)
        if tick < len(motion.actions):
            place = motion.resting_poses[tick, :2]
            np.testing.assert_allclose(X.translation()[:2], place, atol=1e-9)
    edge = np.abs(guarded.meshes["guard/robot/passed"][:2]).max(axis=1)
    assert edge - 0.015 == pytest.approx(motion.half_size_m, abs=1e-3)
    for tick in range(0, len(motion.actions), 7):
        seen = [
            name
            for name in ("passed", "lessened", "braked")
            if guarded.visible(f"guard/robot/{name}", guarded_run.time[tick])
        ]
        by_number = "passed", "lessened", "lessened", "braked"
        assert seen == [by_number[motion.actions[tick]]]


def test_fine_cells_are_shown_more_seldom(guarded_run):
    """30 million cells in all: of 12.8 m in 5 mm, 2560 by 2560, 4 maps; and the end."""
    end = guarded_run.simulated_s
    times = known_times(guarded_run)
    assert times[:3] == pytest.approx([0.075, 0.5, 1.0])
    assert times[-1] == end
    fine = guarded_run.scenario.follower.own_map.model_copy(update={"cell_m": 0.005})
    scenario = guarded_run.scenario.with_robot(guard=fine)
    seldom = known_times(replace(guarded_run, scenario=scenario))
    assert seldom == pytest.approx([0.075, end / 4, end / 2, 3 * end / 4, end])


def test_runs_without_guard_have_no_such_layers(recorded):
    switched = [path for path, _ in recorded.properties]
    paths = [*recorded.meshes, *recorded.transforms, *switched]
    assert not [path for path in paths if path.startswith(("known", "guard"))]


def test_a_guarded_page_is_little_larger(guarded_run, tmp_path, monkeypatch):
    """What is known and the guard add less than a quarter of a megabyte to 8 s."""
    write_replay(guarded_run, tmp_path / "with.html")
    for place in ("replay.known_space", "overlays.guarded_motion"):
        monkeypatch.setattr(f"analysis.views.{place}", lambda *_: None)
    write_replay(guarded_run, tmp_path / "without.html")
    sizes = [(tmp_path / f"{name}.html").stat().st_size for name in ("with", "without")]
    assert 2e4 < sizes[0] - sizes[1] < 2.5e5


def test_a_robot_on_a_route_shows_its_target_and_its_gains():
    """15 s in, between two contacts of K with 3 N/m at the start: bars of 15 cm."""
    fields = ["law=trajectory_adaptive", "duration_s=16"]
    run = simulate(load_scenario("unknown_block", fields), engine="compiled")
    recorder = recording(run)
    tick, columns = 600, run.columns
    (ball,) = (X for time, X in recorder.transforms["estimate"] if time == 15.0)
    target = [columns["target_x"][tick], columns["target_y"][tick]]
    np.testing.assert_allclose(ball.translation()[:2], target, atol=1e-9)
    scales = dict(recorder.properties["robot/stiffness", "scale"])
    assert scales[0.0] == pytest.approx([1.0, 1.0, 0.15])
    assert scales[15.0][2] == pytest.approx(0.05 * columns["stiffness"][tick])
    assert scales[15.0][2] > 0.151
    assert "robot/bar" not in recorder.shapes  # which carries microphones
    assert "goals/robot" in recorder.shapes
