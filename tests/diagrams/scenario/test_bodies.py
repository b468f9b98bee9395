"""Paths of robots: recorded ones, and those of a run in progress."""

from __future__ import annotations

import numpy as np
import pytest

from diagrams.scenario.bodies import Body, RecordedPath, Surroundings
from systems.world.shapes import box


def test_a_recorded_path_is_straight_between_ticks():
    path = RecordedPath(
        np.array([0.0, 1.0, 3.0]), np.array([[0, 0, 0], [1, 2, 4], [1, 0, 0]])
    )
    assert path.moves
    assert path.pose(0.5) == pytest.approx((0.5, 1.0, 2.0))
    assert path.pose(2.0) == pytest.approx((1.0, 1.0, 2.0))
    np.testing.assert_allclose(path.poses([-1.0, 9.0]), [[0, 0, 0], [1, 0, 0]])


def test_what_is_followed_is_no_obstacle():
    bodies = {
        name: Body(RecordedPath(np.zeros(1), np.array([[k, 0, 0]])), box((1.0, 1.0)))
        for k, name in enumerate("abc")
    }
    around = Surroundings(bodies, "b")
    assert list(around.obstacles) == ["a", "c"]
    assert around.followed.path.pose(0.0)[0] == 1
