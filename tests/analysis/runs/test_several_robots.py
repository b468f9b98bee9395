"""Metrics, summary, pictures and replay of a run of several robots."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from analysis.runs.metric_table import run_metrics
from analysis.runs.run_report import run_document, run_text
from analysis.views.picture import plot_trajectory
from analysis.views.replay import record, write_replay
from analysis.views.run_directory import write_run
from analysis.views.scene import make_scene
from diagrams import RunResult, load_scenario, simulate


@pytest.fixture(scope="module")
def convoy() -> RunResult:
    return simulate(
        load_scenario("convoy", ["hearing=ideal", "duration_s=8"]), engine="compiled"
    )


def test_metrics_are_those_of_each_robot(convoy):
    """The clearance between two robots is the same from both."""
    metrics = run_metrics(convoy)
    for name, own in convoy.robots.items():
        for metric, value in run_metrics(own).items():
            assert metrics[f"{name}.{metric}"] == value
    gap = metrics["second.minimum_clearance_m"]
    assert gap == pytest.approx(metrics["leader.minimum_obstacle_clearance_m"])
    # The leader is what it follows, and so no obstacle; the source is one.
    beside = metrics["second.minimum_obstacle_clearance_m"]
    assert gap is not None
    assert beside is not None
    assert beside > gap + 0.5


def test_summary_names_each_robot(convoy):
    summary = run_document(convoy)
    assert {name: row["cause"] for name, row in summary["robots"].items()} == {
        "leader": "completed",
        "second": "completed",
    }
    text = run_text(convoy, summary)
    assert text.count("follow distance") == 2
    assert "second                completed, law active" in text


def test_a_directory_holds_files_of_each_robot(convoy, tmp_path):
    write_run(convoy, run_document(convoy), tmp_path)
    names = {path.name for path in tmp_path.iterdir()}
    assert {f"time_series_{robot}.png" for robot in convoy.robots} <= names
    assert {f"diagram_{robot}.svg" for robot in convoy.robots} <= names
    assert load_scenario(tmp_path / "scenario.yaml") == convoy.full_scenario
    assert "robots" in json.loads((tmp_path / "summary.json").read_text())
    world = (tmp_path / "diagram.svg").read_text()
    assert ">leader<" in world
    assert "tdoa estimator" not in world


def test_each_robot_has_its_own_color_and_label(convoy):
    bodies = make_scene(convoy).bodies
    colors = [bodies[name].color for name in convoy.robots]
    assert len(set(colors)) == len(colors) == 2
    (axes,) = plot_trajectory(convoy).axes
    _, labels = axes.get_legend_handles_labels()
    for name, own in convoy.robots.items():
        (line,) = (k for k in axes.lines if k.get_label() == f"path of P of {name}")
        np.testing.assert_array_equal(line.get_xdata(), own.columns["p_WP_x"])
        assert f"{name} with its microphones" in labels


def test_the_replay_has_every_robot_and_source(convoy, tmp_path: Path):
    write_replay(convoy, tmp_path / "replay.html")
    page = (tmp_path / "replay.html").read_bytes()
    assert len(page) > 100_000


def test_each_robot_moves_in_the_replay(convoy):
    paths: set[str] = set()

    class Recorder:
        def __getattr__(self, name: str):
            return lambda path, *rest, **_: paths.add(path)

    scene = make_scene(convoy)
    record(cast("Any", Recorder()), scene, scene.things)
    expected = {"robots/leader", "robots/second", "source", "estimates/second"}
    assert expected <= paths
    assert "robots/leader/rings/1" in paths, "its loudspeaker"
    assert "robots/second/rings/1" not in paths


def test_a_robot_of_several_can_be_drawn_alone(convoy):
    for name, own in convoy.robots.items():
        (axes,) = plot_trajectory(own).axes
        (path,) = (
            k for k in axes.lines if k.get_label() == "path of the control point P"
        )
        np.testing.assert_array_equal(path.get_xdata(), own.columns["p_WP_x"])
        assert make_scene(own).bodies[name].path == "robot"
