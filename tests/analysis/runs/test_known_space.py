"""What is worked out from the log is what the robot's own map held."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import diagrams.running.simulation
from analysis.runs.known_space import (
    has_known_space,
    known_space,
    remembered_space,
)
from diagrams import build_sound_follower, load_scenario, simulate
from systems import FreeSpaceMap
from systems.framework.block import copied

#: Sensors all at once, and in turn with echoes that get lost and places that do.
KINDS = {
    "simultaneous": (),
    "sequential": (
        "ultrasonic.firing=sequential",
        "ultrasonic.dropout_probability=0.1",
        "guard.wheel_error=0.02",
        "guard.place_error_m=0.03",
    ),
}


def guarded(*overrides):
    return load_scenario(
        "two_static_obstacles", ["hearing=ideal", "guard={}", *overrides]
    )


def assert_same(ours, theirs):
    for name in ("free_until", "hits", "first", "rolled_m", "ends"):
        np.testing.assert_array_equal(getattr(ours, name), getattr(theirs, name), name)


def last(result):
    *_, space = remembered_space(result)
    return space


@pytest.mark.parametrize("kind", KINDS)
def test_it_is_what_the_block_holds_at_the_end_of_a_run(kind, monkeypatch):
    scenario = guarded("duration_s=6", *KINDS[kind])
    simulators, make = [], diagrams.running.simulation.make_simulator

    def kept(follower):
        simulators.append(make(follower))
        return simulators[-1]

    monkeypatch.setattr(diagrams.running.simulation, "make_simulator", kept)
    follower = build_sound_follower(scenario, log=True)
    result = simulate(scenario, follower=follower)
    (parts,) = follower.robots.values()
    block = parts.blocks["free_space"]
    context = block.GetMyContextFromRoot(simulators[-1].get_context())
    held = parts.port("free_space", "free_space").Eval(context)
    assert np.count_nonzero(held.hits) > 20
    assert_same(last(result), held)


@pytest.mark.slow
def test_it_is_what_a_compiled_loop_holds_at_the_end(monkeypatch):
    spaces, step_for = [], FreeSpaceMap.step_for

    def kept(self, run):
        step = step_for(self, run)
        spaces.append(step.state.free_space)
        return step

    monkeypatch.setattr(FreeSpaceMap, "step_for", kept)
    scenario = guarded("duration_s=6", *KINDS["sequential"])
    result = simulate(scenario, engine="compiled")
    held = copied(spaces[-1])
    assert result.engine == "compiled"
    assert np.count_nonzero(held.hits) > 20
    assert_same(last(result), held)


def test_at_the_start_the_bubble_is_free_and_what_three_cones_saw(guarded_run):
    known = known_space(guarded_run, [0.0])
    assert known is not None
    assert known.times == pytest.approx([0.0])
    corners = np.arange(-20, 21) * 0.05
    # Corners on the circle, as (0.6, 0.8), are left to rounding.
    inside = np.hypot(corners[:, None], corners) < 1.0 - 1e-9
    whole = inside[1:, 1:] & inside[:-1, 1:] & inside[1:, :-1] & inside[:-1, :-1]
    middles = known.middles(known.free[0])
    near = np.hypot(*middles.T) <= 1.0
    within = {tuple(np.floor(place / 0.05).astype(int)) for place in middles[near]}
    assert {tuple(cell - 20) for cell in np.argwhere(whole)} <= within
    # What lies beyond was seen by cones that begin at P and open 90 degrees in all.
    beyond = middles[~near & (np.hypot(*middles.T) > 1.05)] - [0.175, 0.0]
    assert len(beyond) > 10
    assert np.all(np.abs(np.arctan2(beyond[:, 1], beyond[:, 0])) < math.pi / 4.0)


def test_nothing_is_known_free_where_a_body_stands(guarded_run):
    known = known_space(guarded_run, guarded_run.time[::40])
    assert known is not None
    for free in known.free:
        places = known.middles(free)
        for obstacle in guarded_run.scenario.obstacles:
            x, y, _ = obstacle.path().pose(0.0)
            away = np.abs(places - [x, y]) - np.array(obstacle.size_m) / 2.0
            assert np.all(away.max(axis=1) > 0.0)


def test_echoes_come_from_the_obstacles(guarded_run):
    """Some cell with an echo lies within a cell of each obstacle that was met."""
    known = known_space(guarded_run, [guarded_run.simulated_s])
    assert known is not None
    assert not np.any(known.free & (known.hits > 0.0))
    echoes = known.middles(known.hits[0] > 0.0)
    for obstacle in guarded_run.scenario.obstacles:
        x, y, _ = obstacle.path().pose(0.0)
        away = np.abs(echoes - [x, y]) - np.array(obstacle.size_m) / 2.0
        assert np.min(np.hypot(*np.maximum(away, 0.0).T)) < 0.05


def test_snapshots_lie_on_one_grid(guarded_run):
    """Each snapshot is the same alone, on a grid of its own."""
    times = [0.0, 1.0, 3.0]
    known = known_space(guarded_run, times)
    assert known is not None
    x_low, x_high, y_low, y_high = known.extent
    shape = round((x_high - x_low) / 0.05), round((y_high - y_low) / 0.05)
    assert known.free.shape == (3, *shape)
    for k, time in enumerate(times):
        alone = known_space(guarded_run, time)
        assert alone is not None
        for name in ("free", "hits"):
            of_all, of_one = getattr(known, name)[k], getattr(alone, name)[0]
            np.testing.assert_allclose(
                known.middles(of_all > 0), alone.middles(of_one > 0), atol=1e-9
            )


def test_the_window_that_leaves_a_place_forgets_it(monkeypatch):
    monkeypatch.setattr("systems.safety.parameters.WINDOW_M", 4.0)
    monkeypatch.setattr("systems.safety.parameters._WINDOW_RADII", 0.0)
    result = simulate(guarded("duration_s=6"))
    known = known_space(result, [0.0, result.simulated_s])
    assert known is not None
    first, final = (known.middles(free) for free in known.free)
    assert first[:, 0].min() < -0.9
    # The robot is 1.3 m on; its window reaches 2 m and a slack of 20 cells back.
    x = result.columns["p_WB_estimated_x"][-1]
    assert final[:, 0].min() >= x - 2.0 - 1.0 - 0.05
    assert final[:, 0].max() <= x + 2.0 + 1.0 + 0.05


def test_a_run_of_one_tick_is_known():
    result = simulate(guarded("duration_s=0.01"))
    known = known_space(result, [0.0, 1.0])
    assert known is not None
    assert known.free.shape[0] == 1


def test_runs_without_guard_know_nothing(crossing_run, ideal_run):
    for result in (crossing_run, ideal_run):
        assert not has_known_space(result)
        assert known_space(result, [0.0]) is None


def test_a_log_without_poses_tells_nothing(guarded_run):
    columns = dict(guarded_run.columns)
    del columns["p_WB_estimated_x"]
    assert not has_known_space(replace(guarded_run, columns=columns))
