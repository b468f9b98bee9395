"""What a simulated robot hears, heard again: in its diagram and from the file."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from pydrake.systems.framework import LeafSystem

from analysis.arrays.array_geometry import load_geometry
from analysis.arrays.live_hearing import HeardStep, LiveHearing, listen_to
from analysis.arrays.sound_pipe import open_pipe
from diagrams import (
    RunAudio,
    build_sound_follower,
    load_scenario,
    make_simulator,
    simulate,
)
from docs.building.page_code import page_file
from phonotaxis import locate

SECONDS = 1.5
# The robot is all but at rest, and has the source to its left.
OVERRIDES = (
    f"duration_s={SECONDS}",
    "start.heading_deg=-25",
    "robot.top_speed_m_s=0.02",
)


@pytest.fixture(scope="module")
def scenario(tmp_path_factory):
    """The robot has the listener of docs/recordings.md."""
    file = tmp_path_factory.mktemp("block") / "talkers.py"
    file.write_text(page_file("recordings.md", "talkers.py"), "utf-8")
    return load_scenario("obstacle_free", [*OVERRIDES, f"blocks=[{file}:Talkers]"])


@pytest.fixture(scope="module")
def run(scenario, tmp_path_factory):
    """The files' directory, and the run's trajectory."""
    folder = tmp_path_factory.mktemp("run") / "ears"
    with RunAudio(scenario, folder) as audio:
        result = simulate(scenario, audio=audio)
    return folder, result.trajectory


def true_bearing_deg(trajectory) -> float:
    """From the microphones' centroid, (0.175, 0) in B, at the end of the run."""
    last = trajectory.iloc[-1]
    turn = last.theta_WB
    ahead = np.array([math.cos(turn), math.sin(turn)])
    to = np.array([last.p_WS_x, last.p_WS_y])
    to = to - (np.array([last.p_WB_x, last.p_WB_y]) + 0.175 * ahead)
    return math.degrees(math.atan2(ahead[0] * to[1] - ahead[1] * to[0], to @ ahead))


def listened(folder):
    told: list[HeardStep] = []
    geometry = load_geometry(folder / "array.yaml")
    stream = open_pipe((folder / "heard.wav").open("rb"), raw_channels=3)
    heard = listen_to(LiveHearing(stream, geometry), told.append)
    assert not heard.faults
    return [step.sources for step in told]


def test_the_file_has_the_source_where_it_is(run):
    folder, trajectory = run
    true = true_bearing_deg(trajectory)
    assert abs(true) > 15.0
    found = locate(folder / "heard.wav", load_geometry(folder / "array.yaml"))
    assert not found.faults
    bearings = [estimate.bearing_deg for estimate in found.estimates]
    assert np.median(np.array(bearings, dtype=float)) == pytest.approx(true, abs=1.5)
    (track,) = listened(folder)[-1].tracks
    assert math.degrees(track.bearing) == pytest.approx(true, abs=1.5)


def test_the_block_in_the_diagram_tells_what_listen_tells_of_the_file(run, scenario):
    folder, _ = run
    follower = build_sound_follower(scenario)
    simulator = make_simulator(follower)
    block: LeafSystem = follower.blocks["listener"]
    context = block.GetMyContextFromRoot(simulator.get_context())
    for sources in listened(folder):
        simulator.AdvanceTo(sources.t_s + 1e-3)
        told: Any = block.GetOutputPort("sources").Eval(context)
        assert told.t_s == pytest.approx(sources.t_s)
        assert len(told.tracks) == len(sources.tracks)
        for ours, theirs in zip(told.tracks, sources.tracks, strict=True):
            assert ours.identity == theirs.identity
            assert ours.bearing == pytest.approx(theirs.bearing, abs=1e-4)
