"""Exact obstacle sensing against positions worked out by hand."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st

from phonotaxis.testing import assert_linearization, evaluate
from systems.base.robot import RobotParameters
from systems.ranging.ideal_obstacle_sensor import IdealObstacleSensor, nearest_vectors
from systems.world.geometry import rectangle_corners

FAR = [50.0, 0.0, 0.0]
place = st.floats(-2.0, 2.0)
angle = st.floats(-3.0, 3.0)


def scene(pose_WB=(0.0, 0.0, 0.0)) -> dict[str, Any]:
    """Two boxes: 1 m to P's left (a face), and ahead right (a corner)."""
    return {
        "pose_WB": pose_WB,
        "poses_WO": [0.175, 1.5, 0.0, 1.175 + 0.4, -1.3, math.pi / 2],
        "sizes": [0.4, 1.0, 0.0, 0.2, 0.8, 0.0],
        "pose_WS": [3.0, 0.0, 0.0],
    }


def test_nearest_body_only():
    outputs = evaluate(IdealObstacleSensor(obstacle_count=2), **scene())
    vectors = outputs["collision_vectors_B"]
    np.testing.assert_allclose(vectors, [0, 1, 0, 0, 0, 0], atol=1e-12)
    np.testing.assert_array_equal(outputs["features"], [1, 0, 0])


def test_all_bodies_nearest_first():
    """Turned by 90 deg, the second box's near corner lies at (1.175, -1.2)."""
    block = IdealObstacleSensor(obstacle_count=2, all_bodies=True)
    outputs = evaluate(block, **scene())
    vectors = outputs["collision_vectors_B"]
    ahead = 3.0 - 0.163 - 0.175
    expected = [0.0, 1.0, 1.0, -1.2, ahead, 0.0]
    np.testing.assert_allclose(vectors, expected, atol=1e-12)
    np.testing.assert_array_equal(outputs["features"], [1, 2, 3])


def test_vectors_are_given_in_the_body_frame():
    """Facing north from 0.175 m to the left of and behind P's old place."""
    pose_WB = (0.175, -0.175, math.pi / 2)
    outputs = evaluate(IdealObstacleSensor(obstacle_count=2), **scene(pose_WB))
    vectors = outputs["collision_vectors_B"]
    np.testing.assert_allclose(vectors[:2], [1.0, 0.0], atol=1e-12)


@pytest.mark.parametrize(("maximum", "seen"), [(0.99, 0), (1.01, 1)])
def test_bodies_beyond_the_range_are_not_seen(maximum, seen):
    block = IdealObstacleSensor(obstacle_count=2, maximum_range_m=maximum)
    assert evaluate(block, **scene())["features"][0] == seen


def test_more_bodies_than_slots():
    block = IdealObstacleSensor(obstacle_count=4, all_bodies=True)
    outputs = evaluate(
        block,
        pose_WB=[0, 0, 0],
        poses_WO=[0, 2, 0, 0, -1.5, 0, 0, 1, 0, 2.5, 0, 0],
        sizes=[0.1, 0.1, 0.0] * 4,
        pose_WS=FAR,
    )
    np.testing.assert_array_equal(outputs["features"], [3, 2, 1])


def test_of_bodies_at_one_distance_the_first_one_comes_first():
    """Ahead and behind, in either order."""
    bodies = [(1.0, 0.0, 0.0, 0.2, 0.2, 0.0), (-1.0, 0.0, 0.0, 0.2, 0.2, 0.0)]
    for order in (bodies, bodies[::-1]):
        vectors = nearest_vectors((0.0, 0.0, 0.0), order, range(2), 0.0, 9.0, 2)
        assert [feature for feature, _, _ in vectors] == [1.0, 2.0]


@given(place, place, angle, place, place, angle)
def test_nearest_point_against_a_grid(x, y, theta, x_O, y_O, theta_O):
    body = (x_O, y_O, theta_O, 0.6, 0.4, 0.0)
    vectors = nearest_vectors((x, y, theta), [body], [0], 0.175, 50.0, 1)
    ((_, dx, dy),) = vectors
    p = np.array([x + 0.175 * math.cos(theta), y + 0.175 * math.sin(theta)])
    front_left, rear_left, _, front_right = rectangle_corners(body)
    u, v = np.meshgrid(np.linspace(0, 1, 61), np.linspace(0, 1, 41))
    along, across = rear_left - front_left, front_right - front_left
    grid = front_left + u[..., None] * along + v[..., None] * across
    sampled = np.min(np.linalg.norm(grid - p, axis=-1))
    assert math.hypot(dx, dy) == pytest.approx(sampled, abs=0.011)
    assert math.hypot(dx, dy) <= sampled + 1e-9


@pytest.mark.parametrize("all_bodies", [False, True])
@pytest.mark.parametrize("radius", [0.0, 0.15])
def test_gradient(all_bodies, radius):
    block = IdealObstacleSensor(
        robot=RobotParameters(control_point_m=0.2),
        maximum_range_m=1.4,
        obstacle_count=1,
        all_bodies=all_bodies,
        source_size=(0.5, 0.2),
    )
    assert_linearization(
        block,
        pose_WB=[0.1, -0.2, 0.4],
        poses_WO=[1.3, 0.5, 0.7],
        sizes=[0.4, 0.3, radius],
        pose_WS=[0.3, -1.2, 0.2],
        hold=["sizes"],
    )
