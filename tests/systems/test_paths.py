"""Paths through waypoints: lengths in closed form, speed by differences."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from systems.paths import WaypointPath

CORNER = ((0.0, 0.0), (2.0, 0.0), (2.0, 3.0))

coordinate = st.integers(-30, 30).map(lambda n: n / 10.0)
waypoint_lists = st.lists(
    st.tuples(coordinate, coordinate), min_size=2, max_size=6
).filter(lambda points: all(math.dist(*pair) > 0.2 for pair in pairwise(points)))


def make_path(points, **settings) -> WaypointPath:
    """A path, or another example where the waypoints double back."""
    try:
        return WaypointPath(points, speed=0.3, **settings)
    except ValueError:
        assume(False)
        raise


@pytest.mark.parametrize("radius", [0.0, 0.3, 1.0])
def test_length_with_a_rounded_right_angle(radius):
    """A quarter circle replaces two tangents of the radius."""
    path = WaypointPath(CORNER, speed=1.0, corner_radius=radius)
    assert path.length == pytest.approx(5.0 - 2 * radius + radius * math.pi / 2)


def test_corner_takes_at_most_half_of_the_shorter_leg():
    path = WaypointPath(CORNER, speed=1.0, corner_radius=10.0)
    assert path.length == pytest.approx(5.0 - 2.0 + math.pi / 2)  # radius 1


def test_corner_is_passed_at_the_arc_s_distance():
    path = WaypointPath(CORNER, speed=1.0, corner_radius=0.5)
    times = np.linspace(0, path.length, 20_001)
    nearest = min(math.dist(path.pose(t)[:2], (2.0, 0.0)) for t in times)
    assert nearest == pytest.approx(0.5 * (math.sqrt(2) - 1), abs=1e-6)


def test_pose_on_the_legs():
    path = WaypointPath(CORNER, speed=0.5, corner_radius=0.5)
    assert path.pose(2.0) == pytest.approx((1.0, 0.0, 0.0))
    ahead = path.length / 0.5 - 2.0  # 1 m before the end
    assert path.pose(ahead) == pytest.approx((2.0, 2.0, math.pi / 2))
    assert path.velocity(ahead) == pytest.approx((0.0, 0.5, 0.0))


def test_yaw_rate_on_the_arc_is_speed_over_radius():
    left = WaypointPath(CORNER, speed=0.3, corner_radius=0.5)
    right = WaypointPath([(x, -y) for x, y in CORNER], speed=0.3, corner_radius=0.5)
    middle = (1.5 + 0.5 * math.pi / 4) / 0.3
    assert left.velocity(middle)[2] == pytest.approx(0.6)
    assert right.velocity(middle)[2] == pytest.approx(-0.6)


@given(waypoint_lists, st.floats(0.05, 1.0), st.floats(0.01, 0.99))
def test_velocity_is_the_derivative_of_the_pose(points, radius, part):
    path = make_path(points, corner_radius=radius)
    time, h = part * path.length / 0.3, 1e-5
    ends = [s / 0.3 for s in path._ends]
    assume(min(abs(time - end) for end in (0.0, *ends)) > 2 * h)
    before, after = path.pose(time - h), path.pose(time + h)
    change = [(b - a) / (2 * h) for a, b in zip(before, after, strict=True)]
    np.testing.assert_allclose(path.velocity(time), change, atol=1e-6, rtol=1e-4)


@given(waypoint_lists, st.floats(0.0, 1.0))
def test_speed_is_exact_and_the_path_has_no_gap(points, radius):
    path = make_path(points, corner_radius=radius)
    times = np.linspace(0, path.length / 0.3, 401)[:-1]
    for time in times:
        assert math.hypot(*path.velocity(time)[:2]) == pytest.approx(0.3)
    places = np.array([path.pose(t)[:2] for t in times])
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    assert np.all(steps <= 0.3 * (times[1] - times[0]) + 1e-9)


@given(waypoint_lists)
def test_sharp_path_is_as_long_as_its_legs(points):
    path = make_path(points, corner_radius=0.0)
    legs = sum(math.dist(*pair) for pair in pairwise(points))
    assert path.length == pytest.approx(legs)


@given(waypoint_lists, st.floats(0.0, 1.0))
def test_begins_and_ends_at_the_outer_waypoints(points, radius):
    path = make_path(points, corner_radius=radius)
    assert path.pose(0.0)[:2] == pytest.approx(points[0])
    assert path.pose(1e6)[:2] == pytest.approx(points[-1])
    assert path.velocity(1e6) == (0.0, 0.0, 0.0)


def test_rests_until_its_start_time():
    path = WaypointPath(CORNER, speed=0.5, start_time=3.0)
    assert path.pose(2.9) == (0.0, 0.0, 0.0)
    assert path.velocity(2.9) == (0.0, 0.0, 0.0)
    assert path.pose(4.0) == pytest.approx((0.5, 0.0, 0.0))


@given(st.floats(0.0, 30.0))
def test_shuttle_comes_back_the_way_it_went(after):
    path = WaypointPath(CORNER, speed=0.5, at_end="shuttle")
    turn = path.length / 0.5
    assert path.pose(turn + after) == pytest.approx(path.pose(abs(turn - after)))
    assert path.pose(2 * turn + after) == pytest.approx(path.pose(after))


def test_shuttle_drives_backwards():
    path = WaypointPath(CORNER, speed=0.5, corner_radius=0.5, at_end="shuttle")
    turn = path.length / 0.5
    assert path.velocity(turn + 1.0) == pytest.approx((0.0, -0.5, 0.0), abs=1e-12)
    assert path.pose(turn + 1.0)[2] == pytest.approx(math.pi / 2)


def test_a_single_point_rests_with_its_heading():
    path = WaypointPath([(1.0, 2.0)], speed=0.3, heading=0.7)
    assert path.pose(5.0) == (1.0, 2.0, 0.7)
    assert path.velocity(5.0) == (0.0, 0.0, 0.0)
    assert path.length == 0.0
    assert not path.moves


def test_no_speed_no_motion():
    path = WaypointPath(CORNER, speed=0.0, at_end="shuttle")
    assert not path.moves
    assert path.pose(100.0) == path.pose(0.0)


@pytest.mark.parametrize(
    ("points", "message"),
    [
        ([], "none given; give at least one point"),
        ([(0, 0), (1, 1), (1, 1)], r"\(1, 1\) stands twice in a row; remove one"),
        ([(0, 0), (2, 0), (1, 0)], "doubles back at waypoint 1; move a waypoint"),
    ],
)
def test_impossible_paths_say_how_to_mend_them(points, message):
    with pytest.raises(ValueError, match=message):
        WaypointPath(points, speed=0.3)


@given(
    points=waypoint_lists,
    radius=st.sampled_from([0.0, 0.1, 0.5]),
    at_end=st.sampled_from(["stop", "shuttle"]),
)
def test_many_poses_at_once_are_those_one_by_one(points, radius, at_end):
    path = make_path(points, corner_radius=radius, at_end=at_end, start_time=1.0)
    times = np.linspace(0.0, 4.0 + 2.5 * path.length / 0.3, 41) + 1e-6
    one_by_one = np.array([path.pose(t) for t in times])
    np.testing.assert_allclose(path.poses(times), one_by_one, atol=1e-9)


def test_many_poses_of_a_body_at_rest():
    path = WaypointPath([(1.0, 2.0)], speed=0.3, heading=0.5)
    np.testing.assert_array_equal(path.poses([0.0, 9.0]), [[1.0, 2.0, 0.5]] * 2)
