"""Collision vectors: cases I and II in closed form, the foot by sampling."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from phonotaxis.testing import assert_linearization, evaluate
from systems.ranging.collision_vector import (
    CollisionVector,
    collision_vectors,
    echo_point,
    foot_on_segment,
)
from systems.ranging.parameters import (
    CollisionVectorParameters,
    RangeSensorParameters,
    UltrasonicParameters,
)

PAPER = CollisionVectorParameters()
NEAREST = CollisionVectorParameters(aggregation="nearest")
SUM = CollisionVectorParameters(aggregation="sum")
LEFT = (math.cos(math.pi / 6), math.sin(math.pi / 6))

coordinate = st.floats(-3.0, 3.0)
points = st.tuples(coordinate, coordinate)


def at_ranges(*ranges):
    """Points on the three axes; None is no echo."""
    axes = (math.pi / 6, 0.0, -math.pi / 6)
    return [
        None if r is None else echo_point(r, axis, (0.0, 0.0))
        for r, axis in zip(ranges, axes, strict=True)
    ]


def test_echo_lies_on_the_sensor_s_axis():
    """Eq. 11 prints the minus sign that would put it behind the sensor."""
    assert echo_point(2.0, math.pi / 6, (0.0, 0.0)) == pytest.approx(
        (2.0 * LEFT[0], 2.0 * LEFT[1])
    )
    assert echo_point(2.0, 0.0, (0.1, -0.3)) == pytest.approx((2.1, -0.3))


@given(points, points)
def test_foot_is_the_nearest_point_of_the_segment(a, b):
    foot = foot_on_segment(a, b)
    parts = np.linspace(0.0, 1.0, 2001)[:, None]
    samples = np.array(a) + parts * (np.array(b) - a)
    distances = np.linalg.norm(samples - foot, axis=1)
    assert distances.min() <= math.dist(a, b) / 2000 + 1e-9, "on the segment"
    nearest = np.linalg.norm(samples, axis=1).min()
    assert math.hypot(*foot) <= nearest + 1e-9


@given(points, points)
def test_foot_inside_the_segment_is_perpendicular(a, b):
    foot = np.array(foot_on_segment(a, b))
    if min(math.dist(foot, a), math.dist(foot, b)) > 1e-6:
        assert foot @ np.subtract(b, a) == pytest.approx(0.0, abs=1e-9)


def test_foot_has_no_singular_slope():
    """Eq. 14 divides by the slope: neither 0 nor infinity is special here."""
    assert foot_on_segment((1.0, 0.5), (1.0, -0.5)) == (1.0, 0.0)
    assert foot_on_segment((-1.0, 0.5), (1.0, 0.5)) == (0.0, 0.5)
    assert foot_on_segment((1.0, 0.5), (1.0, 0.5)) == (1.0, 0.5)


def test_foot_stays_on_the_segment():
    """The unbounded line through these would be nearest at (0, 0.5)."""
    assert foot_on_segment((1.0, 0.5), (2.0, 0.5)) == (1.0, 0.5)


def test_no_echo_no_vector():
    for parameters in (PAPER, NEAREST, SUM):
        assert collision_vectors(at_ranges(None, None, None), parameters) == []


@pytest.mark.parametrize("parameters", [PAPER, NEAREST, SUM])
@pytest.mark.parametrize("sensor", [0, 1, 2])
def test_case_1_a_single_echo(parameters, sensor):
    ranges: list[float | None] = [None, None, None]
    ranges[sensor] = 0.7
    (vector,) = collision_vectors(at_ranges(*ranges), parameters)
    expected = at_ranges(0.7, 0.7, 0.7)[sensor]
    assert vector == (1.0 + sensor, *expected)


@pytest.mark.parametrize(
    ("ranges", "feature", "direction_deg"),
    [((0.6, 0.6, None), 4.0, 15.0), ((None, 0.6, 0.6), 5.0, -15.0)],
)
def test_case_2_foot_of_the_perpendicular(ranges, feature, direction_deg):
    """Equal ranges: the chord's foot is r cos 15 deg on the bisector."""
    (vector,) = collision_vectors(at_ranges(*ranges), PAPER)
    c = 0.6 * math.cos(math.radians(15))
    direction = math.radians(direction_deg)
    expected = (feature, c * math.cos(direction), c * math.sin(direction))
    assert vector == pytest.approx(expected)


def test_a_wall_ahead_gives_its_distance():
    """A wall seen on the axes themselves: both pairs have the foot (1, 0)."""
    slant = 0.6 / math.cos(math.pi / 6)
    (vector,) = collision_vectors(at_ranges(slant, 0.6, slant), PAPER)
    assert vector[1:] == pytest.approx((0.6, 0.0))


@pytest.mark.parametrize(("r", "joined"), [(0.96, True), (0.97, False)])
def test_echoes_apart_are_two_obstacles(r, joined):
    """The chord is 2 r sin 15 deg: 0.5 m at r = 0.966 m."""
    (vector,) = collision_vectors(at_ranges(r, r, None), PAPER)
    assert vector[0] == (4.0 if joined else 1.0)


def test_paper_joins_the_nearest_echo_with_its_nearer_neighbor():
    (vector,) = collision_vectors(at_ranges(0.7, 0.5, 0.6), PAPER)
    assert vector[0] == 5.0
    (vector,) = collision_vectors(at_ranges(0.6, 0.5, 0.7), PAPER)
    assert vector[0] == 4.0


def test_paper_keeps_the_outer_sensors_apart():
    """Echoes 1 and 3 alone are no neighbors: a gap, not a wall."""
    (vector,) = collision_vectors(at_ranges(0.5, None, 0.4), PAPER)
    assert vector[0] == 3.0
    assert math.hypot(*vector[1:]) == pytest.approx(0.4)


def test_nearest_takes_one_echo_alone():
    (vector,) = collision_vectors(at_ranges(0.6, 0.5, 0.55), NEAREST)
    assert vector == (2.0, 0.5, 0.0)


def test_sum_gives_every_echo_or_pair_its_vector():
    features = [v[0] for v in collision_vectors(at_ranges(0.5, 0.5, 0.5), SUM)]
    assert features == [4.0, 5.0]
    features = [v[0] for v in collision_vectors(at_ranges(0.5, 0.5, 2.5), SUM)]
    assert features == [4.0, 3.0]
    features = [v[0] for v in collision_vectors(at_ranges(2.5, 1.5, 0.5), SUM)]
    assert features == [1.0, 2.0, 3.0]


@given(
    st.lists(st.one_of(st.none(), st.floats(0.03, 3.0)), min_size=3, max_size=3),
    st.sampled_from([PAPER, NEAREST, SUM]),
)
def test_no_vector_is_longer_than_the_nearest_echo_or_shorter_than_its_foot(
    ranges, parameters
):
    """A foot lies at least cos 15 deg of the nearer range... from equal ones."""
    vectors = collision_vectors(at_ranges(*ranges), parameters)
    heard = [r for r in ranges if r is not None]
    assert bool(vectors) == bool(heard)
    if heard:
        lengths = [math.hypot(x, y) for _, x, y in vectors]
        assert min(lengths) <= min(heard) + 1e-12
        assert min(lengths) >= min(heard) * math.cos(math.radians(15)) - 1e-12


def test_ports_of_one_pair():
    outputs = evaluate(CollisionVector(), ranges=[0.6, 0.6, 3.0], echo=[1, 1, 0])
    c = 0.6 * math.cos(math.radians(15))
    x, y = c * math.cos(math.radians(15)), c * math.sin(math.radians(15))
    np.testing.assert_allclose(
        outputs["collision_vectors_B"], [x, y, 0, 0, 0, 0], atol=1e-15
    )
    np.testing.assert_array_equal(outputs["mask"], [1, 0, 0])
    np.testing.assert_array_equal(outputs["features"], [4, 0, 0])


def test_a_range_without_echo_means_nothing():
    outputs = evaluate(CollisionVector(), ranges=[0.1, 0.6, 0.1], echo=[0, 1, 0])
    np.testing.assert_allclose(outputs["collision_vectors_B"][:2], [0.6, 0.0])


def test_sensors_places_and_axes_are_used():
    sensors = UltrasonicParameters(
        sensors=(
            RangeSensorParameters(axis_deg=90.0, position_m=(0.0, 0.3)),
            RangeSensorParameters(axis_deg=0.0, position_m=(0.1, 0.0)),
            RangeSensorParameters(axis_deg=-90.0, position_m=(0.0, -0.3)),
        )
    )
    block = CollisionVector(parameters=SUM, sensors=sensors)
    outputs = evaluate(block, ranges=[1.0, 2.0, 1.5], echo=[1, 1, 1])
    np.testing.assert_allclose(
        outputs["collision_vectors_B"], [0, 1.3, 2.1, 0, 0, -1.8], atol=1e-15
    )


@pytest.mark.parametrize("parameters", [PAPER, NEAREST, SUM])
@pytest.mark.parametrize("ranges", [(0.6, 0.5, 0.8), (0.9, 0.7, 0.45), (2.0, 0.4, 1.0)])
def test_gradient(parameters, ranges):
    sensors = UltrasonicParameters(
        sensors=tuple(RangeSensorParameters(axis_deg=a) for a in (35.0, 5.0, -30.0))
    )
    block = CollisionVector(parameters=parameters, sensors=sensors)
    assert_linearization(block, ranges=ranges, echo=[1, 1, 1], hold=["echo"])


def test_gradient_of_ranges_that_are_carried_on():
    """By the ranges, and by the poses now and in the two ticks before."""
    sensors = UltrasonicParameters(firing="sequential")
    assert_linearization(
        CollisionVector(parameters=SUM, sensors=sensors),
        state=[0.29, -0.21, 0.38, 0.27, -0.2, 0.35],
        ranges=[0.9, 0.7, 0.8],
        echo=[1, 1, 1],
        range_ages=[0.05, 0.025, 0.0],
        pose_WB_estimated=[0.3, -0.2, 0.4],
        hold=["echo", "range_ages"],
    )


def test_a_held_range_is_turned_and_moved_with_the_robot():
    """Seen 1 m ahead of P at the origin; P then moved 0.2 m on and B turned left."""
    block = CollisionVector(
        parameters=NEAREST, sensors=UltrasonicParameters(firing="sequential")
    )
    outputs = evaluate(
        block,
        state=[-0.175, 0.0, 0.0, 9.0, 9.0, 9.0],
        ranges=[3.0, 1.0, 3.0],
        echo=[0, 1, 0],
        range_ages=[0.0, 0.025, 0.05],
        pose_WB_estimated=[0.2, -0.175, math.pi / 2],
    )
    C = outputs["collision_vectors_B"][:2]
    np.testing.assert_allclose(C, [0.0, -0.8], atol=1e-12)
