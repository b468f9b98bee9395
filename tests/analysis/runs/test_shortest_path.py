"""Shortest ways against closed forms and a grid."""

from __future__ import annotations

import heapq
import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, strategies as st

from analysis.runs.shortest_path import shortest_path_length
from systems.world.geometry import nearest_point_on_rectangle

RADIUS = 0.41
SPECK = (0.0, 0.0, 0.3, 1e-9, 1e-9, 0.0)


def test_straight_to_the_circle_round_the_goal():
    assert shortest_path_length((0, 0), (3, 4), 1.5, [], RADIUS) == pytest.approx(3.5)
    assert shortest_path_length((0, 0), (1, 0), 1.5, [], RADIUS) == 0.0


def test_round_a_point_are_two_tangents_and_an_arc():
    """2 sqrt(d^2 - r^2) + r (pi - 2 arccos(r/d)) for d = 2 m on both sides."""
    exact = 2 * math.sqrt(4 - RADIUS**2) + RADIUS * (
        math.pi - 2 * math.acos(RADIUS / 2)
    )
    length = shortest_path_length((-2, 0), (2, 0), 0.0, [SPECK], RADIUS)
    assert exact <= length <= 1.001 * exact


def test_round_a_wall():
    """Tangent, quarter arc, along the wall's end, and the same again."""
    r, half, thick = 0.2, 1.0, 0.2
    wall = (0.0, 0.0, math.pi / 2, 2 * half, thick, 0.0)
    x = 2.0 - thick / 2
    leg = math.sqrt(x * x + half * half - r * r)
    turn = math.atan2(half, x) + math.asin(r / math.hypot(x, half))
    exact = 2 * leg + 2 * r * turn + thick
    length = shortest_path_length((-2, 0), (2, 0), 0.0, [wall], r)
    assert exact <= length <= 1.001 * exact


def test_a_closed_ring_has_no_way():
    ring = [
        (1.5, 0, 0, 0.1, 3, 0),
        (-1.5, 0, 0, 0.1, 3, 0),
        (0, 1.5, 0, 3, 0.1, 0),
        (0, -1.5, 0, 3, 0.1, 0),
    ]
    assert shortest_path_length((0, 0), (4, 0), 0.5, ring, RADIUS) == math.inf


def test_a_gap_narrower_than_the_disc_is_closed():
    def through(gap: float) -> float:
        half = 0.05 + gap / 2
        posts = [(0, half, 0, 0.1, 0.1, 0), (0, -half, 0, 0.1, 0.1, 0)]
        return shortest_path_length((-2, 0), (2, 0), 0.0, posts, RADIUS)

    assert through(2 * RADIUS + 0.01) == pytest.approx(4.0)
    assert through(2 * RADIUS - 0.01) > 4.1


def test_a_start_beside_a_box_is_no_dead_end():
    """The box is grown by the 0.25 m that it stands away: up its side, round."""
    r, ahead, half = 0.25, 3.0 - 0.35, 0.05
    distance = math.hypot(ahead, half)
    down = math.asin(r / distance) + math.atan2(half, ahead)
    leg = math.sqrt(distance**2 - r * r) - 0.5
    exact = half + r * (math.pi / 2 + down) + 0.1 + leg
    box = (0.3, 0.0, 0.0, 0.1, 2 * half, 0.0)
    length = shortest_path_length((0, 0), (3, 0), 0.5, [box], RADIUS)
    assert exact <= length <= 1.002 * exact


def grid_length(start, goal, goal_radius, boxes, radius, step=0.05) -> float:
    """Dijkstra on a grid with 16 directions: at most 2.8 % too long."""
    low, high = -3.0, 3.0
    count = round((high - low) / step) + 1
    axis = np.linspace(low, high, count)
    x, y = np.meshgrid(axis, axis, indexing="ij")
    free = np.ones((count, count), dtype=bool)
    for box in boxes:
        away = [
            math.hypot(*nearest_point_on_rectangle(point, box))
            for point in zip(x.ravel(), y.ravel(), strict=True)
        ]
        free &= np.reshape(away, x.shape) >= radius
    moves = [
        (i, j)
        for i in range(-2, 3)
        for j in range(-2, 3)
        if math.gcd(abs(i), abs(j)) == 1
    ]
    first = tuple(round((v - low) / step) for v in start)
    queue, seen = [(0.0, first)], set()
    while queue:
        length, here = heapq.heappop(queue)
        if here in seen:
            continue
        seen.add(here)
        if math.dist((axis[here[0]], axis[here[1]]), goal) <= goal_radius:
            return length
        for i, j in moves:
            there = here[0] + i, here[1] + j
            if max(there) < count and min(there) >= 0 and free[there]:
                cost = length + step * math.hypot(i, j)
                heapq.heappush(queue, (cost, there))
    return math.inf


@pytest.mark.parametrize("seed", range(6))
def test_among_boxes_it_is_what_a_grid_finds(seed):
    generator = np.random.default_rng(seed)
    boxes = np.column_stack(
        [
            generator.uniform(-1.2, 1.2, (4, 2)),
            generator.uniform(-3, 3, 4),
            generator.uniform(0.1, 0.8, (4, 2)),
            [0.0, 0.0, 0.05, 0.15],
        ]
    )
    task = ((-2.5, 0.0), (2.5, 0.0), 0.5, boxes, 0.3)
    length, on_grid = shortest_path_length(*task), grid_length(*task)
    assert length >= 4.5 - 1e-9
    # The grid lengthens by 2.8 % and a step at the end, and cannot cut corners
    # finer than a step.
    assert on_grid / 1.028 - 0.15 <= length <= on_grid + 0.05


@given(
    boxes=st.lists(
        st.tuples(
            st.floats(-1.0, 1.0),
            st.floats(-1.5, 1.5),
            st.floats(-3.0, 3.0),
            st.floats(0.05, 1.0),
            st.floats(0.05, 1.0),
            st.just(0.0),
        ),
        max_size=3,
    )
)
def test_a_further_box_never_shortens_the_way(boxes):
    lengths = [
        shortest_path_length((-2.5, 0), (2.5, 0), 0.5, boxes[:count], 0.3)
        for count in range(len(boxes) + 1)
    ]
    assert lengths[0] == pytest.approx(4.5)
    # Polygons for arcs: up to 0.6 % of an arc too long, where a box moves the way.
    assert all(b >= 0.999 * a for a, b in pairwise(lengths))
