"""The outline against points on edges, and against small motions of the body."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from systems.planning.outline_planes import BodyOutline, outline_gap, outline_planes

OUTLINE = BodyOutline(0.455, 0.381, 0.1655)


def edges(x, y, theta, length, width, radius):
    """(800, 2) points along the edges; round corners are not among them."""
    t, end = np.linspace(-0.5, 0.5, 200), np.full(200, 0.5)
    unit = [(t, end), (t, -end), (end, t), (-end, t)]
    points = np.concatenate([np.column_stack(each) for each in unit])
    c, s = math.cos(theta), math.sin(theta)
    return points * [length, width] @ np.array([[c, s], [-s, c]]) + [x, y]


def test_gaps_are_those_of_many_points_on_the_edges():
    draw, apart = np.random.default_rng(5), 0
    for _ in range(80):
        body = np.array([0.1, -0.2, draw.uniform(-3, 3), 0.5, 0.4, 0.0])
        place = draw.uniform(-1.5, 1.5, 2)
        size, radius = draw.uniform(0.05, 1.0, 2), draw.choice([0.0, 0.1])
        obstacle = np.array([*place, draw.uniform(-3, 3), *size, radius])
        gap, x, y, nx, ny = outline_gap(body, obstacle)
        own, others = edges(*body), edges(*obstacle)
        expected = cdist(own, others).min() - radius
        if expected > 0.05:
            apart += 1
            assert gap == pytest.approx(expected, abs=1e-3)
            there = np.array([[x - (gap + radius) * nx, y - (gap + radius) * ny]])
            assert cdist([[x, y]], own).min() < 3e-3
            assert cdist(there, others).min() < 3e-3
    assert apart > 40


def test_a_plane_limits_the_speed_at_which_the_gap_shrinks():
    """By moving the body for 10 us: the gap shrinks by 4 (gap - 2 cm)/s at most."""
    draw, counted, T = np.random.default_rng(6), 0, 1e-5
    for _ in range(200):
        pose = np.array([*draw.uniform(-0.2, 0.2, 2), draw.uniform(-3, 3)])
        place, size = draw.uniform(-0.8, 0.8, 2), draw.uniform(0.1, 0.4, 2)
        box = np.array([*place, 0.3, *size, 0.0])
        body = np.array([*pose, OUTLINE.length_m, OUTLINE.width_m, 0.0])
        gap = outline_gap(body, box)[0]
        planes = outline_planes(pose, box[None], OUTLINE)
        if not 0.03 < gap < 0.5 or len(planes) == 0:
            continue
        (plane,) = planes
        along = draw.uniform(-0.5, 0.5)
        c, s = math.cos(pose[2]), math.sin(pose[2])
        # A velocity of P on the border of the half plane, and the twist of the body.
        v = plane[2] * plane[:2] + along * np.array([-plane[1], plane[0]])
        if math.hypot(*v) > 1.0:
            continue
        ahead, turn = c * v[0] + s * v[1], (c * v[1] - s * v[0]) / 0.1655
        body[:3] += T * ahead * c, T * ahead * s, T * turn
        rate = (outline_gap(body, box)[0] - gap) / T
        assert rate == pytest.approx(-4.0 * (gap - 0.02), abs=2e-3)
        counted += 1
    assert counted > 40


def test_what_is_far_limits_nothing_and_a_point_ahead_the_speed():
    far = np.array([[3.0, 0.0, 0.0, 1.0, 1.0, 0.0]])
    assert len(outline_planes(np.zeros(3), far, OUTLINE)) == 0
    # A point 0.4 m ahead of P, which is 0.062 m behind the front of the body.
    ahead = np.array([[0.1655 + 0.4, 0.0, 0.0, 0.0, 0.0, 0.0]])
    (plane,) = outline_planes(np.zeros(3), ahead, OUTLINE)
    gap = 0.4 + 0.1655 - 0.2275
    np.testing.assert_allclose(plane, [-1.0, 0.0, -4.0 * (gap - 0.02)], atol=1e-12)
