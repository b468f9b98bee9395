"""Tracks worked out from the log are those that the law had."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.runs.tracked_bodies import TrackedBodies, tracked_bodies
from diagrams import build_sound_follower, load_scenario, make_simulator, simulate

SETTINGS = ["hearing=ideal", "law=guarded", "duration_s=9"]


@pytest.fixture(scope="module")
def run():
    return simulate(load_scenario("one_moving_obstacle", SETTINGS), engine="compiled")


def tracked(run, times) -> TrackedBodies:
    found = tracked_bodies(run, times)
    assert found is not None
    return found


def test_they_are_those_of_the_block(run):
    """Its abstract state at the end of Drake's run, an update after the last tick."""
    follower = build_sound_follower(load_scenario("one_moving_obstacle", SETTINGS))
    simulator = make_simulator(follower)
    simulator.Initialize()
    simulator.AdvanceTo(8.0 + 1e-6)
    context = follower.blocks["controller"].GetMyContextFromRoot(
        simulator.get_context()
    )
    _, state, _ = context.get_abstract_state(0).get_value()
    hazards = state.hazards
    found = tracked(run, [2.0, 8.0])
    assert found.times == pytest.approx([2.0, 8.0])
    exists = hazards.exists
    assert exists.max() > 0.5
    np.testing.assert_allclose(found.exists[1], exists, atol=1e-9)
    best = int(np.argmax(exists))
    x, y, vx, vy, weight = (values[best] for values in hazards.particles)
    mean = np.average([x, y, vx, vy], axis=1, weights=weight)
    np.testing.assert_allclose(found.places[1, best], mean[:2], atol=1e-6)
    np.testing.assert_allclose(found.velocities[1, best], mean[2:], atol=1e-6)


def test_the_body_is_where_they_say(run):
    """Within 0.4 m of its middle most of the time that a track is likely and narrow."""
    found = tracked(run, run.time)
    obstacle = run.scenario.obstacles[0].path().poses(run.time)[:, :2]
    sure = (found.exists > 0.5) & (found.spreads < 0.2)
    assert sure.any(axis=1).sum() > 40
    off = np.linalg.norm(found.places - obstacle[:, None], axis=2)
    assert np.mean(off[sure] < 0.4) > 0.9


def test_empty_tracks_are_nowhere(run):
    found = tracked(run, run.time[::10])
    empty = found.exists == 0.0
    assert np.isnan(found.places[empty]).all()
    assert np.isfinite(found.places[~empty]).all()


def test_only_of_the_law_that_tracks():
    unguarded = simulate(
        load_scenario("obstacle_free", ["hearing=ideal"]), engine="compiled"
    )
    assert tracked_bodies(unguarded, [1.0]) is None
