"""Closed loops, pauses, turns back, and waypoints with times: times in closed form.

From rest to rest over L with a trapezoid of v and a takes L/v + v/a. A turn on the spot
by an angle takes angle/1.5 + 0.5 s.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given, strategies as st

from systems.base.carrier_parameters import SourceRobotParameters
from systems.world.parameters import ObstacleParameters
from systems.world.paths import WaypointPath

SQUARE = [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)]
CORNER = [(0.0, 0.0), (2.0, 0.0), (2.0, 3.0)]
QUARTER_TURN_S, HALF_TURN_S = math.pi / 3.0 + 0.5, math.pi / 1.5 + 0.5


def leg_time(length, speed=0.5, acceleration=1.0):
    return length / speed + speed / acceleration


def check_kinematics(path, times, acceleration=1.0):
    """Velocities are differences of poses, and nothing jumps."""
    h = 1e-5
    before, after = path.poses(times - h), path.poses(times + h)
    change = (after - before) / (2 * h)
    velocities = np.array([path.velocity(time) for time in times])
    smooth = np.abs(change[:, 2]) < 100.0  # the heading may jump by a whole turn
    # Within h, the speed changes by h a, and the yaw rate steps at the ends of an arc.
    near = np.hypot(1.0, velocities[:, 2]) * h * 4 + 1e-9
    assert np.all(np.abs(change - velocities)[:, :2] <= near[:, None])
    steps = np.abs(change - velocities)[smooth, 2] > 1e-3
    assert steps.sum() <= 4
    assert (~smooth).sum() <= 2
    return velocities


@pytest.mark.parametrize("repeated", [False, True])
def test_a_loop_drives_a_closed_polygon_with_four_round_corners(repeated):
    points = [*SQUARE, SQUARE[0]] if repeated else SQUARE
    path = WaypointPath(points, speed=0.5, corner_radius=0.4, at_end="loop")
    lap = 8.0 - 8 * 0.4 + 2 * math.pi * 0.4
    assert path.length == pytest.approx(lap)
    assert path.duration == pytest.approx(lap / 0.5)
    assert path.pose(0.0) == (0.0, 0.0, 0.0)
    # 0.25 s behind a body that starts with 0.5 m/s, and past the corner from then on.
    past = 0.4 / 0.5 + 0.25
    for laps in (0, 1, 2, 1000):
        when = past + laps * lap / 0.5
        assert path.pose(when) == pytest.approx((0.4, 0.0, 0.0), abs=1e-9)
        velocity = path.velocity(when + 1e-6)
        assert velocity == pytest.approx((0.5, 0.0, 0.0), abs=1e-9)
        middle = when + (1.2 + 0.4 * math.pi / 4) / 0.5
        off = 0.4 * (1.0 - math.sqrt(0.5))
        assert path.pose(middle) == pytest.approx((2 - off, off, math.pi / 4))
    check_kinematics(path, np.linspace(0.01, 3 * lap / 0.5, 3001))


def test_a_loop_s_corner_at_its_seam_is_as_slow_as_the_others():
    """1.2 m from 0.32 m/s (0.8 rad/s, 0.4 m) to 1 m/s and back."""
    path = WaypointPath(
        SQUARE, speed=1.0, corner_radius=0.4, at_end="loop", top_yaw_rate=0.8
    )
    peak = math.sqrt(0.32**2 + 1.2)
    assert peak > 1.0
    straight = 2 * 0.68 + (1.2 - (1 - 0.32**2)) / 1.0
    lap = 4 * (straight + math.pi / 2 / 0.8)
    assert path.duration == pytest.approx(lap)
    speeds, yaw_rates = path.twists(np.linspace(5.0, 5.0 + lap, 20_001)).T
    assert speeds[np.abs(yaw_rates) > 0].max() == pytest.approx(0.32)
    assert speeds.max() == pytest.approx(1.0)


def test_a_loop_speeds_up_for_laps_if_it_must():
    """A round of radius 0.5 m: the speed after s is sqrt(2 a s), up to 1 m/s."""
    points = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]
    path = WaypointPath(
        points, speed=1.0, acceleration=0.05, corner_radius=0.5, at_end="loop"
    )
    assert path.length == pytest.approx(math.pi)
    times = np.linspace(0.0, 60.0, 6001)
    expected = np.minimum(0.05 * times, 1.0)
    np.testing.assert_allclose(path.twists(times)[:, 0], expected, atol=1e-9)
    settled = path.poses(times[2500:])[:, :2]
    np.testing.assert_allclose(np.linalg.norm(settled, axis=1), 0.5, atol=1e-9)
    with pytest.raises(ValueError, match=r"acceleration_m_s2.*more than 1000 laps"):
        WaypointPath(points, speed=90.0, acceleration=0.05, at_end="loop")


def test_a_pause_on_a_line_and_at_a_corner():
    """The body stops at the waypoint itself, turns last, and drives on."""
    path = WaypointPath([(0, 0), (1, 0), *CORNER[1:]], speed=0.5, pauses=[1, 2.5, 3, 9])
    first = 1.0 + leg_time(1.0)
    assert path.pose(1.0) == (0.0, 0.0, 0.0)
    assert path.pose(first - 1.0)[0] == pytest.approx(0.625)
    for when in (first, first + 2.5):
        assert path.pose(when) == pytest.approx((1.0, 0.0, 0.0))
        assert path.velocity(when) == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)
    second = first + 2.5 + leg_time(1.0)
    leaves = second + 3.0
    assert path.pose(leaves - QUARTER_TURN_S) == pytest.approx((2.0, 0.0, 0.0))
    halfway = leaves - QUARTER_TURN_S / 2
    assert path.pose(halfway) == pytest.approx((2.0, 0.0, math.pi / 4))
    assert path.velocity(halfway) == pytest.approx((0.0, 0.0, 1.5))
    assert path.pose(leaves) == pytest.approx((2.0, 0.0, math.pi / 2))
    assert path.duration == pytest.approx(leaves + leg_time(3.0))
    check_kinematics(path, np.linspace(0.01, path.duration + 1, 2003))
    # The turn takes longer than a short pause.
    short = WaypointPath(CORNER, speed=0.5, pauses=[0, 0.1, 0])
    assert short.duration == pytest.approx(
        leg_time(2.0) + QUARTER_TURN_S + leg_time(3.0)
    )


def test_a_way_out_and_back_turns_on_the_spot():
    path = WaypointPath([(0, 0), (2, 0), (0.5, 0)], speed=0.5)
    assert path.duration == pytest.approx(leg_time(2.0) + HALF_TURN_S + leg_time(1.5))
    assert path.pose(leg_time(2.0) + HALF_TURN_S / 2) == pytest.approx(
        (2.0, 0.0, math.pi / 2)
    )
    assert path.pose(1e3) == pytest.approx((0.5, 0.0, math.pi))
    # A loop of two points is the same way for ever.
    path = WaypointPath([(0, 0), (2, 0)], speed=0.5, at_end="loop", pauses=[0, 4])
    lap = 2 * leg_time(2.0) + 4.0 + HALF_TURN_S
    assert path.duration == pytest.approx(lap)
    for laps in (0, 1, 50):
        out = path.pose(laps * lap + leg_time(2.0) / 2)
        assert out == pytest.approx((1.0, 0.0, 0.0), abs=1e-9)
        back = path.pose(laps * lap + 1.5 * leg_time(2.0) + 4.0)
        assert back == pytest.approx((1.0, 0.0, math.pi), abs=1e-9)
    check_kinematics(path, np.linspace(0.01, 2.5 * lap, 2003))


def test_a_shuttle_pauses_at_both_ends_and_in_between_on_both_ways():
    path = WaypointPath(
        [(0, 0), (1, 0), (3, 0)], speed=0.5, at_end="shuttle", pauses=[1, 2, 3]
    )
    way = leg_time(1.0) + 2.0 + leg_time(2.0)
    assert path.pose(1.0 + way + 2.9) == pytest.approx((3.0, 0.0, 0.0))
    assert path.pose(4.0 + way + leg_time(2.0) + 1.0) == pytest.approx((1.0, 0.0, 0.0))
    assert path.velocity(4.0 + way + 1.0)[0] == pytest.approx(-0.5)
    period = 4.0 + 2 * way
    times = np.linspace(0.0, period, 301)
    np.testing.assert_allclose(
        path.poses(times + 3 * period), path.poses(times), atol=1e-9
    )
    check_kinematics(path, np.linspace(0.01, 2 * period, 2003))


def test_a_leg_with_times_has_the_speed_of_a_trapezoid():
    """3 m in 4 s at 1 m/s^2: v = (4 - sqrt(16 - 12)) / 2 = 1 m/s."""
    path = WaypointPath([(0, 0), (3, 0)], speed=10.0, times=[2.0, 6.0])
    assert path.pose(2.0) == (0.0, 0.0, 0.0)
    assert path.velocity(3.0) == pytest.approx((1.0, 0.0, 0.0))
    assert path.velocity(5.0) == pytest.approx((1.0, 0.0, 0.0))
    assert path.pose(6.0) == pytest.approx((3.0, 0.0, 0.0))
    assert path.velocity(6.0) == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)


@given(
    points=st.lists(
        st.tuples(st.integers(-9, 9), st.integers(-9, 9)), min_size=2, max_size=5
    ),
    steps=st.lists(st.floats(12.0, 60.0), min_size=5, max_size=5),
    stops=st.lists(st.sampled_from([0.0, 1.0]), min_size=6, max_size=6),
    start=st.floats(0.0, 2.0),
    at_end=st.sampled_from(["stop", "shuttle", "loop"]),
)
def test_waypoints_are_reached_at_their_times(points, steps, stops, start, at_end):
    points = [(float(x), float(y)) for x, y in points]
    if at_end == "loop":
        points.append(points[0])
    assume(all(a != b for a, b in pairwise(points)))
    count, radius = len(points), 0.3
    times = start + np.concatenate([[0.0], np.cumsum(steps[: count - 1])])
    pauses = stops[:count]
    path = WaypointPath(
        points,
        speed=30.0,
        acceleration=2.0,
        corner_radius=radius,
        times=times.tolist(),
        at_end=at_end,
        pauses=pauses,
    )
    period = times[-1] - times[0]
    for lap in (0, 1, 7) if at_end == "loop" else (0,):
        for k, (time, pause) in enumerate(zip(times, pauses, strict=True)):
            when = time + lap * period
            apart = math.dist(path.pose(when)[:2], points[k])
            first, last = k == 0 and lap == 0, k == count - 1
            if pause or first or (last and at_end != "loop"):
                assert apart < 1e-9
                assert np.hypot(*path.velocity(when)[:2]) < 1e-6
                later = path.pose(when + pause)[:2]
                assert last or later == pytest.approx(points[k], abs=1e-9)
            else:  # beside the corner, where the arc is nearest
                early, late = (
                    math.dist(path.pose(when + each)[:2], points[k])
                    for each in (-0.02, 0.02)
                )
                assert apart <= min(early, late) + 1e-9
    span = np.linspace(0.01, times[-1] * 2 + 1, 1501)
    velocities = check_kinematics(path, span)
    if at_end == "stop":
        assert path.pose(1e5)[:2] == pytest.approx(points[-1])
        assert not velocities[span > times[-1] + 1e-6].any()


def test_a_timed_loop_of_four_equal_sides_keeps_its_speed():
    points = [*SQUARE, SQUARE[0]]
    path = WaypointPath(
        points, speed=1.0, corner_radius=0.4, times=[0, 4, 8, 12, 16], at_end="loop"
    )
    side = 2.0 - 2 * 0.4 + 0.4 * math.pi / 2
    speeds = path.twists(np.linspace(16.0, 80.0, 1001))[:, 0]
    np.testing.assert_allclose(speeds, side / 4.0, atol=1e-9)


def obstacle(**fields):
    return ObstacleParameters(**{"waypoints_m": CORNER, **fields})


def leader(**fields):
    return SourceRobotParameters(**{"waypoints_m": CORNER, **fields})


@pytest.mark.parametrize(
    ("make", "fields", "message"),
    [
        (obstacle, {"pauses_s": [1]}, r"pauses_s: has 1 values for 3 waypoints; give "),
        (obstacle, {"waypoint_times_s": [0, 4]}, r"times_s: has 2 values for 3 wayp"),
        (obstacle, {"waypoint_times_s": [0, 4, 4]}, r"times_s\.2: 4 s is not after "),
        (
            obstacle,
            {"waypoint_times_s": [0, 1, 9]},
            r"from waypoints_m.0 to waypoints_m.1, 1\.\d+ m in 1 s need an acc",
        ),
        (
            obstacle,
            {"waypoint_times_s": [0, 9, 10], "pauses_s": [0, 2, 0]},
            r"at 10 s, the body is still at the waypoint before, until 11",
        ),
        (
            obstacle,
            {"waypoint_times_s": [0, 9, 18], "at_end": "loop"},
            r"return to the first waypoint; add \[0.0, 0.0\] to the end of way",
        ),
        (
            obstacle,
            {"waypoint_times_s": [0, 9, 18], "speed_m_s": 0.2},
            r"speed_m_s: 0.2 m/s cannot hold with waypoint_times_s",
        ),
        (
            obstacle,
            {"waypoint_times_s": [0, 9, 18], "start_time_s": 3.0},
            r"3 s cannot hold with waypoint_times_s.*write 3 as its",
        ),
        (
            leader,
            {"waypoint_times_s": [0, 5.5], "waypoints_m": [(0, 0), (4, 0)]},
            r"4 m in 5.5 s need 0.863 m/s, which is above 0\.785 m/s; allow more time",
        ),
        (
            leader,
            {"waypoint_times_s": [0, 4.5, 11], "corner_radius_m": 0.1},
            r"a corner needs a yaw rate of [\d.]+ rad/s, which is above 1\.49 rad/s",
        ),
    ],
)
def test_impossible_schedules_say_how_to_mend_them(make, fields, message):
    with pytest.raises(ValueError, match=message):
        make(**fields)


def test_the_stated_acceleration_suffices():
    """The refusal names an acceleration, which is the least that is accepted."""
    with pytest.raises(ValueError, match="acceleration of") as refused:
        WaypointPath(CORNER, speed=50.0, times=[0, 1, 3], corner_radius=0.1)
    needed = float(str(refused.value).split("acceleration of ")[1].split(" ")[0])
    for factor, good in ((0.99, False), (1.01, True)):
        try:
            WaypointPath(
                CORNER,
                speed=50.0,
                times=[0, 1, 3],
                corner_radius=0.1,
                acceleration=factor * needed,
            )
        except ValueError:
            assert not good
        else:
            assert good


@pytest.mark.parametrize(
    "fields",
    [
        {"at_end": "loop"},
        {"at_end": "loop", "pauses_s": [0, 2, 0]},
        {"at_end": "shuttle", "pauses_s": [1, 2, 3]},
        {"waypoint_times_s": [1, 8, 18], "pauses_s": [0, 2, 0]},
        {"waypoints_m": [(0, 0), (2, 0), (0.5, 0)]},
    ],
)
def test_a_leader_keeps_to_its_schedule(fields):
    """Its wheels keep it within 5 mm, also in turns on the spot."""
    source = SourceRobotParameters(**{"waypoints_m": CORNER, **fields})
    path, plan = source.path(), source.plan()
    times = np.arange(0.0, 50.0, 0.03)
    apart = path.poses(times) - plan.poses(times)
    assert np.hypot(*apart[:, :2].T).max() < 5e-3
    turned = np.mod(apart[:, 2] + math.pi, math.tau) - math.pi
    assert np.abs(turned).max() < 0.15
    assert np.abs(turned[-1]) < 0.02
