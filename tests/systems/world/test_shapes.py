"""Shapes of obstacles: their regions by other means, their fields, and refusals."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, strategies as st
from matplotlib.path import Path
from pydantic import ValidationError

from systems.world.cones import cone_range
from systems.world.parameters import ObstacleParameters
from systems.world.plane import beyond_rectangle
from systems.world.shapes import crossing_edges, polygon, rectangle_outline, wall

L_SHAPE = ((0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 1.0), (1.0, 3.0), (0.0, 3.0))
place = st.floats(-4.0, 4.0)


def obstacle(**fields):
    return ObstacleParameters.model_validate({"name": "rock", **fields})


def distance(shape, pose, point):
    rows = shape.at(pose)
    return min(math.hypot(*beyond_rectangle(point, row)) for row in rows)


@given(place, place, st.floats(-3.0, 3.0), place, place)
def test_what_a_polygon_fills_is_what_matplotlib_says(x, y, theta, px, py):
    shape = polygon(L_SHAPE[::-1])
    c, s = math.cos(theta), math.sin(theta)
    turned = np.array(L_SHAPE) @ np.array([[c, s], [-s, c]]) + [x, y]
    own = np.array([[c, -s], [s, c]]).T @ (np.array([px, py]) - [x, y])
    if distance(shape, (x, y, theta), (px, py)) > 1e-9:
        inside = Path(turned).contains_point((px, py))
        assert bool(shape.fills(own)) == inside


@given(place, place)
def test_a_wall_is_what_lies_near_its_line(px, py):
    """Half of 0.4 m from the line, by 3,000 points of it."""
    points = ((-2.0, 0.0), (1.0, 0.0), (1.0, 2.0))
    off = distance(wall(points, 0.4), (0.5, 0.0, 0.0), (px, py))
    line = np.concatenate([np.linspace(a, b, 1500) for a, b in pairwise(points)])
    sampled = np.min(np.hypot(*(line - [px - 0.5, py]).T)) - 0.2
    assert off == pytest.approx(max(sampled, 0.0), abs=2e-3)


def test_rectangles_of_a_body_move_with_it():
    shape = wall(((1.0, 0.0), (1.0, 2.0)), 0.1)
    (row,) = shape.at((3.0, 4.0, math.pi / 2))
    np.testing.assert_allclose(row, [2.0, 5.0, math.pi, 2.0, 0.0, 0.05], atol=1e-12)
    many = shape.at([(3.0, 4.0, math.pi / 2)] * 2)
    np.testing.assert_array_equal(many, [[row, row]])


@given(st.floats(0.0, 6.0), st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
def test_a_box_by_its_corners_is_seen_as_a_box(x, y, axis):
    box = obstacle(size_m=(1.0, 0.6), waypoints_m=[[3.0, 0.4]], heading_deg=25.0)
    corners = rectangle_outline(box.shape().at(box.path().pose(0.0))[0]).tolist()
    same = obstacle(polygon_m=corners)
    seen = [
        cone_range(x, y, axis, 0.3, each.shape().at(each.path().pose(0.0)))
        for each in (box, same)
    ]
    if seen[0] > 0.0:
        assert seen[1] == pytest.approx(seen[0], abs=1e-6)


def test_forces_and_ranges_do_not_depend_on_how_a_wall_is_cut():
    whole = wall(((0.0, 0.0), (4.0, 0.0)), 0.2)
    cut = wall([(0.1 * k, 0.0) for k in range(41)], 0.2)
    rng = np.random.default_rng(1)
    for x, y, axis in rng.uniform([-1, 0.2, -3], [5, 2, 3], (200, 3)):
        ranges = [cone_range(x, y, axis, 0.2, each.rectangles) for each in (whole, cut)]
        assert ranges[1] == pytest.approx(ranges[0], abs=1e-9)
        near = [distance(each, (0, 0, 0), (x, y)) for each in (whole, cut)]
        assert near[1] == pytest.approx(near[0], abs=1e-12)


def test_fields_of_shapes():
    box = obstacle()
    assert box.size_m == (0.1, 0.05)
    disc = obstacle(radius_m=0.3)
    assert disc.size_m is None
    np.testing.assert_array_equal(disc.shape().rectangles, [[0, 0, 0, 0, 0, 0.3]])
    person = obstacle(preset="person", waypoints_m=[[0, 0], [4, 0]])
    assert (person.radius_m, person.speed_m_s) == (0.25, 1.3)
    assert obstacle(preset="person", size_m=[0.5, 0.3]).radius_m is None
    assert obstacle(preset="person", speed_m_s=0.8).speed_m_s == 0.8
    fence = obstacle(wall_m=[[0, 0], [2, 0], [2, 1]], thickness_m=0.2)
    assert fence.waypoints_m == ((0.0, 0.0),)
    assert len(fence.shape().rectangles) == 2
    for each in (box, disc, person, fence, obstacle(polygon_m=L_SHAPE)):
        assert ObstacleParameters.model_validate(each.model_dump()) == each
        assert ObstacleParameters.model_validate(each.model_dump(mode="json")) == each


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"size_m": [1, 1], "radius_m": 0.2}, "'rock' has size_m and radius_m; give"),
        ({"size_m": None}, "'rock' has no shape; give exactly one of size_m"),
        ({"radius_m": 0.0}, "radius_m"),
        ({"polygon_m": [[0, 0], [1, 0]]}, "at least 3"),
        ({"polygon_m": [[0, 0], [1, 0], [1, 0]]}, "points 1 and 2 are both"),
        ({"polygon_m": [[0, 0], [1, 0], [0, 0]]}, "points 2 and 0 are both"),
        (
            {"polygon_m": [[0, 0], [1, 1], [1, 0], [0, 1]]},
            "edges from corner 0, .* and from corner 2, .* touch",
        ),
        ({"polygon_m": [[0, 0], [2, 0], [1, 0]]}, "touch"),
        ({"wall_m": [[0, 0], [0, 0]]}, "wall_m.*points 0 and 1 are both"),
        ({"wall_m": [[0, 0], [1, 0]], "thickness_m": 0.0}, "thickness_m"),
        ({"preset": "car"}, "person"),
    ],
)
def test_other_shapes_are_refused(fields, message):
    with pytest.raises((ValidationError, ValueError), match=f"(?s){message}"):
        obstacle(**fields)


def test_crossing_edges_of_random_polygons():
    """Stars around their center do not cross; exchanging two corners usually does."""
    rng, crossed = np.random.default_rng(2), 0
    for _ in range(60):
        angle = np.sort(rng.uniform(0.0, 2.0 * math.pi, 9))
        if np.max(np.diff(angle, append=angle[0] + 2.0 * math.pi)) > 3.0:
            continue
        far = rng.uniform(0.5, 2.0, 9)
        star = list(zip(far * np.cos(angle), far * np.sin(angle), strict=True))
        assert crossing_edges(star) is None
        star[2], star[6] = star[6], star[2]
        crossed += crossing_edges(star) is not None
    assert crossed > 40
