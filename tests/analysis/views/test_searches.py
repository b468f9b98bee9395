"""Plume, panels and lamps of a search are those of its run."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from analysis.runs.metric_table import run_metrics
from analysis.views.bursts import call_time
from analysis.views.overlays import overlays
from analysis.views.picture import plot_trajectory
from analysis.views.plume_history import concentration_map, plume_history
from analysis.views.replay import frame_times, record
from analysis.views.scene import make_scene
from analysis.views.time_series import plot_time_series
from diagrams import RunResult, load_scenario, simulate
from systems.odor.odor_plume import concentration

NEAR = [
    "robots.finder.start.position_m=[0.1, 0.05]",
    "robots.finder.search.wait_s=2.0",
    "room=null",
]


@pytest.fixture(scope="module")
def mission() -> RunResult:
    return simulate(load_scenario("odor_then_sound", NEAR), engine="compiled")


def test_the_history_is_the_plume_of_the_run(mission):
    """What the rear sensor was in, at the instants of the plume."""
    own = mission.robots["finder"]
    truth, poses = own.columns["concentration_rear"], own.poses("WB")
    for instant in plume_history(own.full_scenario, 12.0):
        tick = round(instant.time_s / 0.025)
        x, y, theta = poses[tick]
        place = x - 0.2 * np.cos(theta), y - 0.2 * np.sin(theta)
        found = concentration(instant.plume, *place)
        assert found == pytest.approx(truth[tick], abs=1e-12)


def test_a_map_is_of_points(mission):
    plume = next(plume_history(mission.full_scenario, 0.0)).plume
    x, y = np.array([0.0, 1.0, 2.0]), np.array([-0.2, 0.3])
    dense = concentration_map(plume, x, y)
    assert dense.shape == (2, 3)
    assert dense[1, 2] == concentration(plume, 2.0, 0.3)


def test_the_call_is_heard_by_the_sink_soon_after_the_touch(mission):
    found = mission.robots["finder"]
    touched = found.time[np.argmax(found.columns["search_ended"] > 0.5)]
    called = call_time(mission)
    assert called is not None
    assert touched < called < touched + 1.2


class Recorder:
    """Keeps what a Meshcat is told."""

    def __init__(self) -> None:
        self.objects: set[str] = set()
        self.seen: dict[str, list[tuple[float, bool]]] = {}

    def SetObject(self, path: str, *_: Any) -> None:
        self.objects.add(path)

    def SetTransform(self, *_: Any) -> None:
        pass

    SetTriangleMesh = SetObject

    def SetProperty(self, path: str, name: str, *rest: Any, **named: Any) -> None:
        if name == "visible":
            change = named["time_in_recording"], named["value"]
            self.seen.setdefault(path, []).append(change)


def test_lamps_show_what_robots_are_at(mission):
    meshcat: Any = Recorder()
    scene = make_scene(mission)
    layers = [*scene.layers, *overlays(scene, frame_times(mission))]
    record(meshcat, scene, [thing for layer in layers for thing in layer.things])
    assert {"odor/container", "odor/puff_0"} <= meshcat.objects
    for name, own in mission.robots.items():
        ended = own.time[np.argmax(own.columns["search_ended"] > 0.5)]
        assert meshcat.seen[f"robots/{name}/lamp/found"] == [
            (0.0, False),
            (ended, True),
        ]
        moves = np.flatnonzero(np.diff(own.columns["move"]) > 0.5)
        shown = [at for at, seen in meshcat.seen[f"robots/{name}/lamp/moves"] if seen]
        assert len(shown) == len(moves)
    flashes = [at for at, seen in meshcat.seen["robots/finder/radio"] if seen]
    assert flashes


@pytest.mark.parametrize("robot", ["finder", "first"])
def test_pictures_have_what_was_sensed(mission, robot):
    """Five panels of the search; wheels and turn rate."""
    labels = [
        axes.get_ylabel() for axes in plot_time_series(mission.robots[robot]).axes
    ]
    assert len(labels) == 7
    assert ("gas, Rs/R0" in labels) == (robot == "finder")
    assert ("level (dBm)" in labels) == (robot == "first")


def test_the_map_shows_the_plume(mission):
    legend = plot_trajectory(mission).legends[0]
    texts = [text.get_text() for text in legend.get_texts()]
    assert "source of odor" in texts
    assert any(text.startswith("odor at the end") for text in texts)


def test_metrics_count_steps_and_ways(mission):
    metrics = run_metrics(mission)
    own = mission.robots["first"]
    moves = np.sum(np.diff(own.columns["move"]) > 0.5)
    assert metrics["first.search_steps"] == moves
    way = np.hypot(*np.diff(own.vector("p_WB"))).sum()
    assert metrics["first.path_length_m"] == pytest.approx(way)
    p_WB, p_WS = own.vector("p_WB")[:, -1], own.vector("p_WS")[:, -1]
    apart = float(np.hypot(*(p_WB - p_WS)))
    assert metrics["first.final_distance_m"] == pytest.approx(apart, abs=1e-6)
    assert 0.9 < (metrics["first.path_efficiency"] or 0.0) <= 1.0
