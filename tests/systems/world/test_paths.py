"""Paths through waypoints: lengths and times in closed form, speed by differences.

From rest to rest over L with a trapezoid of v and a takes L/v + v/a, and what ramps
up or down is v/2a behind or ahead of what drives at v.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, example, given, strategies as st

from systems.world.paths import WaypointPath

CORNER = ((0.0, 0.0), (2.0, 0.0), (2.0, 3.0))

coordinate = st.integers(-30, 30).map(lambda n: n / 10.0)
waypoint_lists = st.lists(
    st.tuples(coordinate, coordinate), min_size=2, max_size=6
).filter(lambda points: all(math.dist(*pair) > 0.2 for pair in pairwise(points)))


pauses = st.none() | st.lists(st.sampled_from([0.0, 0.4, 3.0]), min_size=6, max_size=6)
ends = st.sampled_from(["stop", "shuttle", "loop"])


def make_path(points, pauses=None, **settings) -> WaypointPath:
    """A path with the first of the pauses; a loop must not repeat its first point."""
    if settings.get("at_end") == "loop":
        assume(math.dist(points[0], points[-1]) > 0.2)
    pauses = pauses[: len(points)] if pauses else ()
    return WaypointPath(points, speed=0.3, pauses=pauses, **settings)


def assume_no_turn_back(points) -> None:
    for (x, y), (x1, y1), (x2, y2) in zip(points, points[1:], points[2:], strict=False):
        turn = math.atan2(y2 - y1, x2 - x1) - math.atan2(y1 - y, x1 - x)
        assume(abs(abs(math.remainder(turn, math.tau)) - math.pi) > 1e-6)


def turning_time(angle):
    """A trapezoid of 1.5 rad/s and 3 rad/s^2, or a triangle."""
    if angle < 1.5**2 / 3.0:
        return 2.0 * math.sqrt(angle / 3.0)
    return angle / 1.5 + 0.5


@pytest.mark.parametrize("radius", [0.1, 0.3, 1.0])
def test_length_with_a_rounded_right_angle(radius):
    """A quarter circle replaces two tangents of the radius."""
    path = WaypointPath(CORNER, speed=1.0, corner_radius=radius)
    assert path.length == pytest.approx(5.0 - 2 * radius + radius * math.pi / 2)


def test_corner_takes_at_most_half_of_the_shorter_leg():
    path = WaypointPath(CORNER, speed=1.0, corner_radius=10.0)
    assert path.length == pytest.approx(5.0 - 2.0 + math.pi / 2)  # radius 1


def test_corner_is_passed_at_the_arc_s_distance():
    path = WaypointPath(CORNER, speed=1.0, corner_radius=0.5)
    times = np.linspace(0, path.duration, 20_001)
    nearest = min(math.dist(path.pose(t)[:2], (2.0, 0.0)) for t in times)
    assert nearest == pytest.approx(0.5 * (math.sqrt(2) - 1), abs=1e-6)


def test_pose_on_the_legs():
    path = WaypointPath(CORNER, speed=0.5, acceleration=1.0, corner_radius=0.5)
    assert path.pose(2.25) == pytest.approx((1.0, 0.0, 0.0))  # 0.25 s behind
    ahead = path.length / 0.5 + 0.5 - 2.25  # 1 m before the end
    assert path.pose(ahead) == pytest.approx((2.0, 2.0, math.pi / 2))
    assert path.velocity(ahead) == pytest.approx((0.0, 0.5, 0.0))


def test_yaw_rate_on_the_arc_is_speed_over_radius():
    left = WaypointPath(CORNER, speed=0.3, acceleration=1.0, corner_radius=0.5)
    mirrored = [(x, -y) for x, y in CORNER]
    right = WaypointPath(mirrored, speed=0.3, acceleration=1.0, corner_radius=0.5)
    middle = (1.5 + 0.5 * math.pi / 4) / 0.3 + 0.15
    assert left.velocity(middle)[2] == pytest.approx(0.6)
    assert right.velocity(middle)[2] == pytest.approx(-0.6)


def test_corners_are_taken_as_slowly_as_the_yaw_rate_asks():
    """At 0.8 rad/s through 0.5 m: 0.4 m/s, reached where the arc begins."""
    path = WaypointPath(
        CORNER, speed=1.0, acceleration=1.0, corner_radius=0.5, top_yaw_rate=0.8
    )
    times = np.linspace(0.0, path.duration, 20_001)
    speeds, yaw_rates = path.twists(times).T
    assert yaw_rates.max() == pytest.approx(0.8)
    assert speeds[yaw_rates > 0.0] == pytest.approx(0.4)
    assert speeds.max() == pytest.approx(1.0)
    # From rest to 1 m/s and down to 0.4 m/s takes 0.5 m + 0.42 m of the leg of 1.5 m.
    first = 1.0 + (1.5 - 0.92) + 0.6
    assert times[yaw_rates > 0.0][0] == pytest.approx(first, abs=1e-3)


@given(waypoint_lists, st.floats(0.05, 1.0), st.floats(0.01, 1.99), ends, pauses)
def test_velocity_is_the_derivative_of_the_pose(points, radius, part, at_end, pauses):
    path = make_path(points, pauses, corner_radius=radius, at_end=at_end)
    time, h = part * path.duration, 1e-5
    elapsed = path._elapsed(np.array([time]))[0]
    assume(min(abs(elapsed - begin) for begin in path._begins) > 2 * h)
    before, after = path.pose(time - h), path.pose(time + h)
    change = [(b - a) / (2 * h) for a, b in zip(before, after, strict=True)]
    np.testing.assert_allclose(path.velocity(time), change, atol=1e-6, rtol=1e-4)


@given(waypoint_lists, st.floats(0.01, 1.0))
@example([(0.0, 0.0), (0.1, 0.0)], 0.1)  # too short to reach its speed
def test_it_takes_the_time_of_a_trapezoid_and_the_path_has_no_gap(points, radius):
    assume_no_turn_back(points)
    path = make_path(points, corner_radius=radius, acceleration=0.5)
    ramps = 0.3**2 / 0.5
    if path.length > ramps:
        assert path.duration == pytest.approx(path.length / 0.3 + 0.3 / 0.5)
    else:
        assert path.duration == pytest.approx(2.0 * math.sqrt(path.length / 0.5))
    times = np.linspace(0, path.duration, 401)
    speeds = path.twists(times)[:, 0]
    expected = np.minimum(0.3, 0.5 * np.minimum(times, path.duration - times))
    np.testing.assert_allclose(speeds, expected, atol=1e-9)
    steps = np.linalg.norm(np.diff(path.poses(times)[:, :2], axis=0), axis=1)
    assert np.all(steps <= 0.3 * (times[1] - times[0]) + 1e-9)


def test_a_short_path_sees_a_triangle():
    """4 cm at 1 m/s^2: 0.2 m/s halfway, after 0.2 s."""
    path = WaypointPath([(0, 0), (0.04, 0)], speed=0.3, acceleration=1.0)
    assert path.duration == pytest.approx(0.4)
    assert path.pose(0.2) == pytest.approx((0.02, 0.0, 0.0))
    assert path.velocity(0.2) == pytest.approx((0.2, 0.0, 0.0))
    assert path.velocity(0.3) == pytest.approx((0.1, 0.0, 0.0))


@given(points=waypoint_lists, at_end=ends, start=st.floats(0.0, 1.0), pauses=pauses)
def test_velocity_has_no_step(points, at_end, start, pauses):
    """Over 1 ms it changes by what acceleration and curvature allow, and no more."""
    path = make_path(points, pauses, at_end=at_end, start_time=start, corner_radius=0.2)
    duration = path.duration
    for moment in (start, start + 0.5 * duration, start + duration):
        times = moment + 1e-3 * np.arange(-600, 600)
        velocities = np.array([path.velocity(time) for time in times])
        steps = np.linalg.norm(np.diff(velocities[:, :2], axis=0), axis=1)
        turning = 0.3 * np.abs(velocities[:, 2])
        most = np.hypot(1.0, np.maximum(turning[1:], turning[:-1]))
        assert np.all(steps <= 1e-3 * most + 1e-9)
        rate = path.velocity(moment)[:2]
        place = np.array([path.pose(moment + late)[:2] for late in (-1e-7, 1e-7)])
        np.testing.assert_allclose(
            np.diff(place, axis=0)[0], 2e-7 * np.array(rate), atol=1e-11
        )


@given(points=waypoint_lists, at_end=ends, until=st.floats(0.0, 30.0), pauses=pauses)
def test_speeds_and_yaw_rates_are_greatest_where_pieces_begin_or_end(
    points, at_end, until, pauses
):
    path = make_path(points, pauses, at_end=at_end, start_time=0.5, top_yaw_rate=1.0)
    found = np.abs(path.extreme_twists(until)).max(axis=0, initial=0.0)
    times = np.linspace(0.0, until, 3001)
    seen = np.abs(path.twists(times)).max(axis=0)
    assert np.all(seen <= found + 1e-9)
    # A hundredth of a second gains 0.01 m/s; a yaw rate may last for less than that.
    assert found[0] <= seen[0] + 0.02


@given(waypoint_lists)
def test_nearly_sharp_path_is_as_long_as_its_legs(points):
    path = make_path(points, corner_radius=1e-9)
    legs = sum(math.dist(*pair) for pair in pairwise(points))
    assert path.length == pytest.approx(legs)


@given(waypoint_lists, st.floats(0.01, 1.0))
def test_begins_and_ends_at_the_outer_waypoints(points, radius):
    path = make_path(points, corner_radius=radius)
    assert path.pose(0.0)[:2] == pytest.approx(points[0])
    assert path.pose(1e6)[:2] == pytest.approx(points[-1])
    assert path.velocity(1e6) == (0.0, 0.0, 0.0)


def test_rests_until_its_start_time():
    path = WaypointPath(CORNER, speed=0.5, acceleration=1.0, start_time=3.0)
    assert path.pose(2.9) == (0.0, 0.0, 0.0)
    assert path.velocity(2.9) == (0.0, 0.0, 0.0)
    assert path.pose(4.0) == pytest.approx((0.375, 0.0, 0.0))


@given(st.floats(0.0, 30.0))
def test_shuttle_comes_back_the_way_it_went(after):
    path = WaypointPath(CORNER, speed=0.5, at_end="shuttle")
    turn = path.length / 0.5 + 0.5
    assert path.pose(turn + after) == pytest.approx(path.pose(abs(turn - after)))
    assert path.pose(2 * turn + after) == pytest.approx(path.pose(after))


def test_shuttle_drives_backwards():
    path = WaypointPath(CORNER, speed=0.5, corner_radius=0.5, at_end="shuttle")
    turn = path.length / 0.5 + 0.5
    assert path.velocity(turn) == pytest.approx((0.0, 0.0, 0.0))
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
        ([], "no point is given"),
        ([(0, 0), (1, 1), (1, 1)], r"\(1, 1\) is listed twice in a row; remove one"),
    ],
)
def test_impossible_paths_say_how_to_mend_them(points, message):
    with pytest.raises(ValueError, match=message):
        WaypointPath(points, speed=0.3)


def test_sharp_corners_are_refused():
    with pytest.raises(ValueError, match=r"corner_radius_m.*give a radius above 0"):
        WaypointPath(CORNER, speed=0.3, corner_radius=0.0)


@given(
    points=waypoint_lists,
    radius=st.sampled_from([0.01, 0.1, 0.5]),
    at_end=ends,
    pauses=pauses,
)
def test_many_poses_at_once_are_those_one_by_one(points, radius, at_end, pauses):
    path = make_path(
        points, pauses, corner_radius=radius, at_end=at_end, start_time=1.0
    )
    times = np.linspace(0.0, 4.0 + 2.5 * path.duration, 41) + 1e-6
    one_by_one = np.array([path.pose(t) for t in times])
    np.testing.assert_allclose(path.poses(times), one_by_one, atol=1e-9)
    headings, (speeds, yaw_rates) = one_by_one[:, 2], path.twists(times).T
    ways = [speeds * np.cos(headings), speeds * np.sin(headings), yaw_rates]
    velocities = [path.velocity(t) for t in times]
    np.testing.assert_allclose(np.transpose(ways), velocities, atol=1e-9)


def test_many_poses_of_a_body_at_rest():
    path = WaypointPath([(1.0, 2.0)], speed=0.3, heading=0.5)
    np.testing.assert_array_equal(path.poses([0.0, 9.0]), [[1.0, 2.0, 0.5]] * 2)
