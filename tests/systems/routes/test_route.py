"""Routes against distances sampled by another program, and the shortest way."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from analysis.runs.shortest_path import shortest_path_length
from systems.framework.input_error import InputError
from systems.routes.route import ROUTE_SIZE
from systems.routes.widest_route import plan_route
from systems.world.geometry import rectangle_corners

CLEARANCE = 0.35
ROOM = [[-5.0, 0, 0, 0.1, 10.2, 0], [5, 0, 0, 0.1, 10.2, 0]]
ROOM += [[0, -5.0, 0, 10.2, 0.1, 0], [0, 5, 0, 10.2, 0.1, 0]]


def sampled_clearance(points, rectangles):
    """Least distance of points every 5 mm of a line from the rectangles' edges."""
    pieces = pairwise(points)
    dense = np.concatenate(
        [np.linspace(a, b, 1 + math.ceil(math.dist(a, b) / 0.005)) for a, b in pieces]
    )
    best = math.inf
    for rectangle in rectangles:
        corners = rectangle_corners(rectangle)
        for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            along = b - a
            part = np.clip((dense - a) @ along / (along @ along), 0.0, 1.0)
            off = dense - a - part[:, None] * along
            best = min(best, np.hypot(*off.T).min())
    return best


def random_room(seed):
    """Boxes in a room 10 m wide; start and goal keep the clearance."""
    generator = np.random.default_rng(seed)
    boxes = [
        [*generator.uniform(-4.5, 4.5, 2), generator.uniform(0, 3.2), *sides, 0]
        for sides in generator.uniform(0.2, 1.6, (generator.integers(4, 16), 2))
    ]
    boxes += ROOM

    def place():
        while True:
            point = generator.uniform(-4.5, 4.5, 2)
            inside = [
                abs(math.cos(t) * (point[0] - x) + math.sin(t) * (point[1] - y)) < a / 2
                and abs(math.cos(t) * (point[1] - y) - math.sin(t) * (point[0] - x))
                < b / 2
                for x, y, t, a, b, _ in boxes
            ]
            if not any(inside) and sampled_clearance([point, point], boxes) > CLEARANCE:
                return tuple(point.tolist())

    return place(), place(), boxes


def test_300_random_maps():
    """Clearance, ends, spacing, and length beside the shortest way's."""
    least, ratios, refused = [], [], 0
    for seed in range(300):
        start, goal, boxes = random_room(seed)
        try:
            route = plan_route(start, goal, boxes)
        except InputError:
            refused += 1
            continue
        points = route.points
        assert tuple(points[0]) == start
        assert tuple(points[-1]) == goal
        assert len(points) <= 200
        steps = np.hypot(*np.diff(points, axis=0).T)
        assert steps.max() <= 1.001 * route.spacing_m
        least.append(sampled_clearance(points, boxes))
        if seed % 10 == 0 and math.dist(start, goal) > 1.0:
            shortest = shortest_path_length(start, goal, 0.0, boxes, CLEARANCE)
            ratios.append(route.length_m / shortest)
    assert refused < 10
    assert min(least) >= 0.92 * CLEARANCE
    assert min(ratios) > 0.97
    assert np.median(ratios) < 1.01
    assert max(ratios) < 1.05


@pytest.mark.parametrize(
    "clearance",
    [0.15, 0.2, 0.35, 0.7],
)
def test_routes_keep_92_percent_of_any_clearance(clearance):
    """Maps of the size of the clearance, measured along the edges of the boxes."""
    generator, shares = np.random.default_rng(7), []
    size = 10.0 * clearance
    for _ in range(60):
        sides = generator.uniform(0.1 * size, 0.4 * size, (8, 2))
        boxes = [
            [*generator.uniform(-size, size, 2), generator.uniform(0, 3.2), *side, 0]
            for side in sides
        ]
        ends = generator.uniform(-size, size, (2, 2))
        if min(sampled_clearance([end, end], boxes) for end in ends) < clearance:
            continue
        start, goal = map(tuple, ends.tolist())
        try:
            route = plan_route(start, goal, boxes, clearance_m=clearance)
        except InputError:  # no way
            continue
        shares.append(sampled_clearance(route.points, boxes) / clearance)
    assert len(shares) >= 10
    assert min(shares) >= 0.92


def test_no_route_begins_with_a_way_through_a_thin_wall():
    """P starts 5 mm beside it, and the nearest free cell is on the other side.

    The other obstacle shifts the cells.
    """
    wall = [[0, 0, 0, 2.0, 0.001, 0], [0, -0.985, 0, 0.01, 0.01, 0]]
    route = plan_route((0.0, 0.0055), (0.0, 1.0), wall)
    assert route.points[:, 1].min() > 0.0025


def test_where_nothing_is_in_the_way_it_is_straight():
    route = plan_route((0.0, 0.1), (3.0, -1.7), ROOM)
    expected = np.linspace((0.0, 0.1), (3.0, -1.7), 200)
    np.testing.assert_allclose(route.points, expected, atol=1e-9)
    assert route.length_m == pytest.approx(math.hypot(3.0, 1.8))
    numbers = route.numbers
    assert numbers.size == ROUTE_SIZE
    assert numbers[0] == 200
    assert numbers[1] == pytest.approx(math.hypot(3.0, 1.8) / 199)
    np.testing.assert_array_equal(numbers[2:402].reshape(-1, 2), route.points)


def test_a_short_route_has_points_every_cm():
    route = plan_route((0.0, 0.0), (0.5, 0.0), [])
    np.testing.assert_allclose(route.points[:, 0], np.linspace(0.0, 0.5, 51))


def test_round_a_post_it_is_tangents_and_an_arc():
    """2 sqrt(4 - r^2) + 2 r asin(r/2): two tangents and the arc between them."""
    post = [[0.0, 0.0, 0.0, 0.0, 0.0, 5e-4]]
    route = plan_route((-2.0, 0.0), (2.0, 0.0), post)
    tangents = 2.0 * math.sqrt(4.0 - CLEARANCE**2)
    expected = tangents + 2.0 * CLEARANCE * math.asin(CLEARANCE / 2.0)
    assert route.length_m == pytest.approx(expected, rel=0.005)


def test_a_start_near_a_wall_is_left_straight_away_from_it():
    wall = [[0.0, 0.0, 0.0, 2.0, 0.1, 0.0]]
    route = plan_route((0.0, 0.15), (0.3, -2.0), wall)
    off = np.abs(route.points[:, 1]) - 0.05
    assert off[0] == pytest.approx(0.1)
    assert sampled_clearance(route.points, wall) >= 0.1 - 0.02
    # Once it is outside of the clearance it keeps it.
    outside = np.argmax(off > CLEARANCE)
    assert sampled_clearance(route.points[outside:], wall) >= CLEARANCE - 0.02


def test_where_rounding_would_cut_a_corner_it_is_less():
    """Round the end of a thin wall whole windows lose 27 mm."""
    wall = [[0.0, 0.0, 0.0, 4.0, 0.01, 0.0]]
    route = plan_route((1.0, 0.3), (1.0, -0.3), wall, clearance_m=0.16)
    assert route.points[:, 0].max() > 2.0
    assert sampled_clearance(route.points, wall) >= 0.16 - 0.02


@pytest.mark.parametrize(
    ("start", "goal", "boxes", "message"),
    [
        (
            (0, 0),
            (2, 0),
            [[2, 0.2, 0, 0.6, 0.6, 0]],
            r"goal_m: \(2, 0\) lies in a known",
        ),
        ((0, 0), (2, 0), [[2, 0.6, 0, 0.6, 0.6, 0]], "goal_m: .* 0.3 m from .* 0.35"),
        (
            (0, 0),
            (2, 0),
            [[0, 0.2, 0, 0.6, 0.6, 0]],
            r"start: P starts at \(0, 0\), in",
        ),
        ((0, 0), (2, 0), [[0, 0, 0.1, 0, 0, 0]], "start"),
        ((1, 1), (1, 1), [], "goal_m: .* where P starts"),
        ((0, 0), (9, 0), ROOM, r"no route leads from \(0, 0\) to \(9, 0\) at 0.35 m"),
    ],
)
def test_what_cannot_be_planned_is_refused(start, goal, boxes, message):
    with pytest.raises(InputError, match=message):
        plan_route(start, goal, boxes)


def test_a_grid_that_is_too_large_is_refused():
    with pytest.raises(InputError, match=r"goal_m: .* 64 m x 64 m, .* than 1000000"):
        plan_route((0, 0), (60, 60), [])
