"""The live view: what Meshcat holds, against the poses of the run."""

from __future__ import annotations

import importlib
import os
import signal
from typing import Any

import numpy as np
import pytest
from pydrake.geometry import Meshcat
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

import phonotaxis
from analysis.views.live_scene import LiveScene
from analysis.views.live_view import LiveView, start_meshcat
from diagrams import build_sound_follower, load_scenario

pytestmark = pytest.mark.drake

PARKED = {"name": "parked", "waypoints_m": [[2.0, -1.5]]}
CART = {"name": "cart", "waypoints_m": [[1.0, 1.5], [2.0, 1.5]], "at_end": "loop"}
FIELDS = {
    "hearing": "ideal",
    "duration_s": 1.5,
    "obstacles": [PARKED, CART],
    "source.waypoints_m": [[3.5, 0.0], [5.0, 0.0]],
}


@pytest.fixture(scope="module")
def meshcat() -> Meshcat:
    return start_meshcat()


def packed(meshcat: Any, kind: str, *names: str) -> Any:
    """What Meshcat sends to browsers, by functions that Drake keeps for tests."""
    unpack: Any = importlib.import_module("msgpack").unpackb
    return unpack(getattr(meshcat, f"_GetPacked{kind}")(*names))


def matrix(meshcat: Meshcat, path: str) -> np.ndarray:
    return np.reshape(packed(meshcat, "Transform", path)["matrix"], (4, 4)).T


def pose(meshcat: Meshcat, path: str) -> list[float]:
    found = matrix(meshcat, path)
    return [found[0, 3], found[1, 3], np.arctan2(found[1, 0], found[0, 0])]


def visible(meshcat: Meshcat, path: str) -> bool:
    return bool(packed(meshcat, "Property", path, "visible")["value"])


@pytest.mark.slow
def test_a_live_run_is_the_same_run_and_meshcat_holds_its_last_tick(meshcat):
    scenario = load_scenario("default", FIELDS)
    plain = phonotaxis.simulate(scenario, engine="drake")
    calls: list[float] = []
    shown = phonotaxis.simulate(
        scenario, meshcat=meshcat, rate=3.0, progress=calls.append
    )
    for name, values in plain.columns.items():
        np.testing.assert_array_equal(shown.columns[name], values, err_msg=name)
    # At three times real time, 1.5 s take half a second.
    assert shown.wall_s > 0.9 * 0.5
    assert len(calls) > 60
    last, end = shown.poses("WB")[-1], scenario.duration_s
    assert pose(meshcat, "robot") == pytest.approx(last)
    assert pose(meshcat, "source") == pytest.approx(scenario.source.path().pose(end))
    cart = scenario.obstacles[1].path().pose(end)
    assert pose(meshcat, "obstacles/cart") == pytest.approx(cart)
    assert pose(meshcat, "obstacles/parked") == pytest.approx([2.0, -1.5, 0.0])
    # The left wheel rolled as far as the middle, less its lever times the turn.
    way = np.hypot(*np.diff(shown.poses("WB")[:, :2], axis=0).T).sum()
    robot = scenario.only.robot
    rolled = (way - 0.5 * robot.wheel_separation_m * last[2]) / robot.wheel_radius_m
    turn = matrix(meshcat, "robot/left/wheel")
    assert rolled > 1.0
    assert turn[:2, 0] == pytest.approx([np.cos(rolled), np.sin(rolled)], abs=2e-3)
    for number in (1, 2, 3):
        echo = shown.columns[f"echo_{number}"][-2] > 0.5
        assert visible(meshcat, f"robot/cone_{number}/echo") == echo
        assert visible(meshcat, f"robot/cone_{number}/empty") != echo
    assert visible(meshcat, "estimate")
    assert [meshcat.HasPath(f"trail/robot/{k}") for k in (1, 3)] == [True, False]


@pytest.mark.slow
def test_it_shows_our_robot_in_a_user_s_diagram(meshcat):
    scenario = load_scenario("default", FIELDS)
    follower = build_sound_follower(scenario)
    builder = DiagramBuilder()
    builder.AddSystem(follower.diagram)
    phonotaxis.add_live_view(builder, follower, meshcat)
    diagram = builder.Build()
    simulator = Simulator(diagram)
    simulator.AdvanceTo(0.5)
    early = pose(meshcat, "robot")
    simulator.AdvanceTo(1.25)
    output = follower.diagram.GetOutputPort("robot.pose_WB")
    context = follower.diagram.GetMyContextFromRoot(simulator.get_context())
    assert pose(meshcat, "robot") == pytest.approx(output.Eval(context))
    assert pose(meshcat, "robot")[0] > early[0] + 0.05


def test_without_inputs_bodies_follow_their_waypoints(meshcat):
    scenario = load_scenario("robots_4", {"duration_s": 2.0})
    view = LiveView(scenario, meshcat)
    simulator = Simulator(view)
    simulator.AdvanceTo(0.1)
    for name, robot in scenario.robots.items():
        assert pose(meshcat, f"robots/{name}") == pytest.approx(robot.start.pose)
        assert meshcat.HasPath(f"goals/robots/{name}")
    crossing = load_scenario("default", FIELDS)
    view = LiveView(crossing, meshcat)
    simulator = Simulator(view)
    simulator.AdvanceTo(1.0)
    cart = crossing.obstacles[1].path().pose(1.0)
    assert pose(meshcat, "obstacles/cart") == pytest.approx(cart)
    assert not meshcat.HasPath("robots/first"), "of the scene before"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"rate": 2.0}, "rate: 2 needs a live view; give meshcat"),
        ({"meshcat": ..., "rate": -1.0}, "rate: is -1; give 1 for real time, or 0"),
        ({"meshcat": ..., "rate": float("nan")}, "rate: is nan; give 1"),
        ({"meshcat": ..., "engine": "compiled"}, "engine: the compiled engine cannot"),
    ],
)
def test_what_cannot_be_shown_is_refused(meshcat, options, message):
    options = {k: meshcat if v is ... else v for k, v in options.items()}
    with pytest.raises(phonotaxis.InputError, match=message):
        phonotaxis.simulate("default", **options)


@pytest.mark.slow
def test_the_command_prints_the_address_and_ends_with_results(tmp_path, capsys):
    words = [f"--set={key}" for key in ("hearing=ideal", "duration_s=0.2")]
    out = tmp_path / "out"
    options = ["--live", "--rate", "0", "--no-plots", "--out", str(out)]
    assert phonotaxis.main(["simulate", *words, *options]) == 0
    assert "live view: http://localhost:" in capsys.readouterr().err
    assert (out / "replay.html").exists()
    assert phonotaxis.main(["simulate", "--rate", "2"]) == 2
    assert "rate: 2 needs --live; add --live" in capsys.readouterr().err


@pytest.mark.slow
def test_an_interrupt_ends_the_view_within_a_tick(tmp_path, capsys, monkeypatch):
    show, times = LiveScene.show, []

    def interrupted(self, time, values):
        show(self, time, values)
        times.append(time)
        if time == pytest.approx(0.2):
            os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(LiveScene, "show", interrupted)
    words = ["simulate", "--live", "--set", "hearing=ideal", "--out", "out"]
    monkeypatch.chdir(tmp_path)
    assert phonotaxis.main(words) == 1
    assert "interrupted; nothing was written" in capsys.readouterr().err
    assert times[-1] <= 0.25
    assert list(tmp_path.iterdir()) == []
