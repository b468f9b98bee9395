"""A scene holds each thing once, where the run's own columns and fields put it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from analysis.report.palette import COLORS
from analysis.runs.run_report import run_document, summary_rows
from analysis.views.bursts import heard_bursts
from analysis.views.curves import panels
from analysis.views.overlays import overlays
from analysis.views.scene import Cone, Thing, Touched, compose, make_scene
from diagrams import load_scenario, simulate


def layers_of(run):
    scene = make_scene(run)
    return [*scene.layers, *overlays(scene, np.arange(0.0, run.simulated_s, 0.5))]


def of_kind(run, kind):
    return [each for each in make_scene(run).things if isinstance(each.shape, kind)]


@pytest.mark.parametrize("name", ["crossing_run", "collision_run", "guarded_run"])
def test_each_thing_has_its_own_path_and_layer(name, request):
    layers = layers_of(request.getfixturevalue(name))
    paths = [thing.path for layer in layers for thing in layer.things]
    assert len(set(paths)) == len(paths)
    labels = [layer.label for layer in layers]
    assert len(set(labels)) == len(labels)
    assert {"robot", "source", "obstacles", "cones", "trails", "law"} <= {*labels}
    assert ("what was hit" in labels) == (name == "collision_run")
    assert ("guard" in labels) == ("known floor" in labels) == (name == "guarded_run")


def test_a_pose_of_a_part_turns_with_its_carrier():
    """A quarter turn to the left at (1, 2) moves 0.5 m ahead to 0.5 m along y."""
    carrier = np.array([1.0, 2.0, math.pi / 2.0])
    expected = [1.0 - 0.2, 2.0 + 0.5, math.pi / 2.0 + 0.1]
    assert compose(carrier, np.array([0.5, 0.2, 0.1])) == pytest.approx(expected)
    times, mount = np.zeros(1), np.array([[0.5, 0.2, 0.1]])
    body = Thing("body", Cone(0.0, times, times > 0.0), "", times, carrier[None])
    part = Thing("part", body.shape, "", times, mount, parent=body)
    assert part.pose(7) == pytest.approx(expected)
    assert not part.moves


def test_cones_begin_at_the_sensors(crossing_run):
    """All three are at P, 0.175 m ahead of B, with axes 30 degrees apart."""
    left, middle, right = of_kind(crossing_run, Cone)
    assert middle.pose(0) == pytest.approx([0.175, 0.0, 0.0])
    assert left.pose(0)[2] == pytest.approx(math.radians(30.0))
    assert right.pose(0)[2] == pytest.approx(-math.radians(30.0))
    assert np.array_equal(middle.shape.reach, crossing_run.columns["range_2"])


def test_what_was_hit_is_seen_from_the_collision_on(collision_run):
    (hit,) = of_kind(collision_run, Touched)
    assert hit.path == "obstacles/box/hit"
    assert hit.pose(0)[:2] == pytest.approx([1.0, 0.1])
    assert hit.shape.shape.rectangles[0, 3:] == pytest.approx([0.3, 0.3, 0.0])
    assert not hit.visible(0)
    assert hit.visible(len(collision_run.time) - 1)


def test_bodies_of_several_robots_have_names_and_colors():
    overrides = [
        "duration_s=0.5",
        "sources={leader: {}, radio: {body: false, waypoints_m: [[3, 3]]}}",
    ]
    scene = make_scene(simulate(load_scenario("two_followers", overrides)))
    robots = [body for body in scene.bodies.values() if "robots/" in body.path]
    assert len({body.color for body in robots}) == len(robots) == 2
    assert [layer.label for layer in scene.layers][:2] == [b.name for b in robots]
    radio = scene.bodies["radio"]
    assert (radio.path, radio.color) == ("sources/radio", COLORS["interferer"])
    assert not radio.moves


def test_a_goal_point_is_no_source_of_sound():
    """Nothing on its pictures or in its summary speaks of sound or of following."""
    goal = {"goal_m": [1.0, 0.5], "duration_s": 1.0, "engine": "compiled"}
    run = simulate(load_scenario({**goal, "law": "conventional"}))
    layers = {layer.label: layer for layer in layers_of(run)}
    assert {"robot", "goal", "law"} <= {*layers}
    assert not {"source", "estimates"} & {*layers}
    assert [thing.path for thing in layers["goal"].things] == ["source"]
    assert heard_bursts(run) == []
    titles = [panel.name for panel in panels(run)]
    assert titles[:2] == ["range of goal", "bearing of goal"]
    rows = summary_rows(run, run_document(run))
    assert "distance at the end" in rows
    assert not {"follow distance", "frames heard"} & {*rows}
