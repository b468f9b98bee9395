"""Planar geometry against dense sampling of edges and areas."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given, strategies as st
from numpy.typing import NDArray
from pydrake.autodiffutils import AutoDiffXd

from systems.world.cones import cone_range
from systems.world.contacts import contact_time, first_overlap
from systems.world.geometry import (
    beyond_rectangle,
    control_point,
    control_point_velocity,
    nearest_point_on_rectangle,
    rectangle_clearance,
    rectangle_corners,
    rotate,
    safe_norm,
)

SPACING = 0.01

place = st.floats(-3.0, 3.0)
angle = st.floats(-math.pi, math.pi)
extent = st.floats(0.02, 2.0)
radius = st.floats(0.02, 0.5)
zero = st.just(0.0)
boxes = st.tuples(place, place, angle, extent, extent, zero)
#: Boxes, line segments, discs, walls with round ends, and boxes with round corners.
rectangles = st.one_of(
    boxes,
    st.tuples(place, place, angle, extent, zero, zero),
    st.tuples(place, place, angle, zero, extent, zero),
    st.tuples(place, place, angle, zero, zero, radius),
    st.tuples(place, place, angle, extent, zero, radius),
    st.tuples(place, place, angle, zero, extent, radius),
    st.tuples(place, place, angle, extent, extent, radius),
)


def edges(rectangle, spacing: float = SPACING) -> NDArray[np.float64]:
    """Points of the outline, at most ``spacing`` apart."""
    x, y, theta, length, width, r = rectangle
    u = np.linspace(-length / 2, length / 2, math.ceil(length / spacing) + 1)
    v = np.linspace(-width / 2, width / 2, math.ceil(width / spacing) + 1)
    ends = (-1.0, 1.0)
    sides = [np.array([u, np.full_like(u, e * (width / 2 + r))]) for e in ends]
    sides += [np.array([np.full_like(v, e * (length / 2 + r)), v]) for e in ends]
    turn = np.linspace(0.0, math.pi / 2, math.ceil(2.0 * r / spacing) + 1)
    arc = r * np.array([np.cos(turn), np.sin(turn)])
    corner = np.array([[length / 2], [width / 2]])
    sides += [np.array([[a], [b]]) * (corner + arc) for a in ends for b in ends]
    u, v = np.concatenate(sides, axis=1)
    c, s = math.cos(theta), math.sin(theta)
    return np.column_stack([x + c * u - s * v, y + s * u + c * v])


def contains(rectangle, points) -> NDArray[np.bool_]:
    """Whether points are inside; nothing is inside a line."""
    x, y, theta, length, width, r = rectangle
    c, s = math.cos(theta), math.sin(theta)
    d = np.asarray(points) - [x, y]
    u, v = c * d[..., 0] + s * d[..., 1], -s * d[..., 0] + c * d[..., 1]
    u, v = np.abs(u) - length / 2, np.abs(v) - width / 2
    beside = (u < 0.0) & (v < 0.0)
    return beside | (np.hypot(np.maximum(u, 0.0), np.maximum(v, 0.0)) < r)


def moved(rectangle, turn: float, shift) -> tuple[float, ...]:
    x, y = rotate(turn, rectangle[0], rectangle[1])
    return (x + shift[0], y + shift[1], rectangle[2] + turn, *rectangle[3:])


def clearance(a, b) -> float:
    return rectangle_clearance(np.array(a, float), np.array(b, float))


def seen(x, y, axis, half_angle, bodies) -> float:
    return cone_range(x, y, axis, half_angle, np.array(bodies, float))


def test_rotate_is_counter_clockwise():
    """Body forward of a robot that faces north is north; eq. 15 prints the inverse."""
    assert rotate(math.pi / 2, 1.0, 0.0) == pytest.approx((0.0, 1.0))


@given(angle, angle, place, place)
def test_rotations_add_and_keep_lengths(a, b, x, y):
    once = rotate(a + b, x, y)
    assert rotate(a, *rotate(b, x, y)) == pytest.approx(once, abs=1e-12)
    assert math.hypot(*once) == pytest.approx(math.hypot(x, y))


@pytest.mark.parametrize("theta", [0.0, 0.7, -2.5])
def test_control_point_velocity_is_the_rate_of_its_place(theta):
    """By central differences of a motion at constant rates."""
    pose, rates, h = np.array([1.0, 2.0, theta]), np.array([0.3, -0.2, 0.9]), 1e-5
    ahead, behind = (control_point(pose + dt * rates, 0.175) for dt in (h, -h))
    expected = np.subtract(ahead, behind) / (2.0 * h)
    found = control_point_velocity(theta, rates, 0.175)
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_control_point_lies_ahead():
    p = control_point((1.0, 2.0, math.radians(30)), 0.2)
    assert p == pytest.approx((1.0 + 0.1 * math.sqrt(3), 2.1))


@given(place, place)
def test_safe_norm_is_the_norm_to_1e_12(x, y):
    assert abs(safe_norm(x, y) - math.hypot(x, y)) <= 1e-12


def test_safe_norm_has_a_gradient_at_zero():
    norm = safe_norm(AutoDiffXd(0.0, 2, 0), AutoDiffXd(0.0, 2, 1))
    np.testing.assert_array_equal(norm.derivatives(), [0.0, 0.0])
    norm = safe_norm(AutoDiffXd(3.0, 2, 0), AutoDiffXd(4.0, 2, 1))
    np.testing.assert_allclose(norm.derivatives(), [0.6, 0.8])


def test_corners_run_counter_clockwise_from_front_left():
    corners = rectangle_corners([1.0, 1.0, math.pi / 2, 2.0, 1.0, 0.0])
    expected = [[0.5, 2.0], [0.5, 0.0], [1.5, 0.0], [1.5, 2.0]]
    np.testing.assert_allclose(corners, expected, atol=1e-15)


@given(st.tuples(place, place), rectangles)
def test_nearest_point_of_a_rectangle(point, rectangle):
    vector = nearest_point_on_rectangle(point, rectangle)
    distance = math.hypot(*vector)
    if contains(rectangle, point):
        assert distance == 0.0
        return
    grown = (*rectangle[:3], *np.add(rectangle[3:], 1e-9))
    assert contains(grown, np.add(point, vector))
    sampled = np.min(np.linalg.norm(edges(rectangle) - point, axis=1))
    assert distance <= sampled + 1e-9
    # Between two samples, a round corner bulges.
    bulge = 0.5 * SPACING if rectangle[5] else 1e-9
    assert sampled <= math.hypot(distance, SPACING) + bulge


@given(st.lists(st.tuples(place, place), min_size=1), rectangles)
def test_nearest_points_of_arrays_are_those_of_each_point(points, rectangle):
    """To the last bit: runs and their analysis must agree."""
    array = nearest_point_on_rectangle(np.array(points).T, rectangle)
    each = [nearest_point_on_rectangle(point, rectangle) for point in points]
    np.testing.assert_array_equal(np.transpose(array), each)


@given(st.tuples(place, place), rectangles)
def test_way_beyond_a_rectangle_is_as_long_along_its_axes(point, rectangle):
    own = math.hypot(*beyond_rectangle(point, rectangle))
    outer = math.hypot(*nearest_point_on_rectangle(point, rectangle))
    assert own == pytest.approx(outer, rel=1e-12)


def sampled_cone_range(x, y, axis, half_angle, bodies) -> float:
    d = np.concatenate([edges(body) for body in bodies]) - [x, y]
    off = np.arctan2(d[:, 1], d[:, 0]) - axis
    inside = np.abs(np.arctan2(np.sin(off), np.cos(off))) <= half_angle
    return float(np.min(np.linalg.norm(d[inside], axis=1), initial=math.inf))


@given(
    place,
    place,
    angle,
    st.floats(0.05, 1.4),
    st.lists(rectangles, min_size=1, max_size=3),
)
def test_cone_range_against_sampled_edges(x, y, axis, half_angle, bodies):
    measured = seen(x, y, axis, half_angle, bodies)
    if any(contains(body, (x, y)) for body in bodies):
        assert measured == 0.0
        return
    assert measured <= sampled_cone_range(x, y, axis, half_angle, bodies) + 1e-9
    if math.isfinite(measured) and measured > 0.1:
        # The nearest sample may lie just outside the cone: widen it by as much.
        wider = half_angle + math.asin(SPACING / measured)
        found = sampled_cone_range(x, y, axis, wider, bodies)
        assert found <= measured + SPACING + 1e-9


@given(place, place, angle, rectangles, angle, st.tuples(place, place))
def test_cone_range_does_not_depend_on_the_frame(x, y, axis, body, turn, shift):
    half_angle = math.radians(15)
    here = seen(x, y, axis, half_angle, [body])
    assume(here > 1e-6)
    # An edge that ends on the cone's border may be seen from one frame alone.
    near = {seen(x, y, axis, half_angle + e, [body]) for e in (-1e-7, 1e-7)}
    assume(max(near) < math.inf or min(near) == math.inf)
    x2, y2 = rotate(turn, x, y)
    there = seen(
        x2 + shift[0],
        y2 + shift[1],
        axis + turn,
        half_angle,
        [moved(body, turn, shift)],
    )
    assert there == pytest.approx(here, abs=1e-5)


def test_cone_sees_a_wall_beside_its_axis():
    """A wall 1 m ahead, axis 30 deg aside: the cone's border at 15 deg is nearest."""
    wall = (1.5, 0.0, 0.0, 1.0, 20.0, 0.0)
    half_angle = math.radians(15)
    expected = 1.0 / math.cos(math.radians(15))
    for axis_deg in (30, -30):
        measured = seen(0.0, 0.0, math.radians(axis_deg), half_angle, [wall])
        assert measured == pytest.approx(expected)
    assert seen(0.0, 0.0, 0.0, half_angle, [wall]) == pytest.approx(1.0)


def test_cone_does_not_see_behind_or_beside():
    box = (-1.0, 0.0, 0.0, 0.1, 0.1, 0.0)
    assert seen(0.0, 0.0, 0.0, math.radians(15), [box]) == math.inf
    beside = (1.0, 1.0, 0.0, 0.1, 0.1, 0.0)
    assert seen(0.0, 0.0, 0.0, math.radians(15), [beside]) == math.inf


@given(rectangles, rectangles)
def test_clearance_is_symmetric(a, b):
    assert clearance(a, b) == pytest.approx(clearance(b, a), abs=1e-12)


@given(rectangles, rectangles, angle, st.tuples(place, place))
def test_clearance_is_invariant_under_rigid_motion(a, b, turn, shift):
    there = clearance(moved(a, turn, shift), moved(b, turn, shift))
    assert there == pytest.approx(clearance(a, b), abs=1e-9)


@given(rectangles, rectangles)
def test_clearance_against_sampled_edges(a, b):
    exact = clearance(a, b)
    ea, eb = edges(a, 0.02), edges(b, 0.02)
    crossing = np.any([*contains(b, ea), *contains(a, eb)])
    nested = contains(b, a[:2]) or contains(a, b[:2])
    if crossing or nested:
        assert exact <= 0.0
    if exact >= 0.0:
        sampled = np.min(np.linalg.norm(ea[:, None] - eb[None], axis=2))
        assert exact <= sampled + 1e-9
        assert sampled <= exact + 0.02


@given(
    st.tuples(place, place, angle, extent, extent, st.one_of(zero, radius)),
    angle,
    st.tuples(extent, extent, st.one_of(zero, radius)),
    st.floats(-0.4, 0.4),
    st.floats(-0.4, 0.4),
)
def test_overlap_is_undone_by_its_depth(a, heading, size, u, v):
    """The shortest push along an edge's normal, found by trying all of them.

    The second center lies inside the first rectangle, so that they overlap.
    """
    c, s = math.cos(a[2]), math.sin(a[2])
    x, y = a[0] + c * u * a[3] - s * v * a[4], a[1] + s * u * a[3] + c * v * a[4]
    b = (x, y, heading, *size)
    depth = -clearance(a, b)
    assert depth > 0.0
    normals = [body[2] + k * math.pi / 2 for body in (a, b) for k in range(4)]
    after = []
    for normal in normals:
        shift = (depth * math.cos(normal), depth * math.sin(normal))
        after.append(clearance(moved(a, 0.0, shift), b))
    assert max(after) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("b", "expected"),
    [
        ((3.0, 0.0, 0.0, 2.0, 1.0, 0.0), 1.0),
        ((1.9, 0.0, 0.0, 2.0, 1.0, 0.0), -0.1),
        ((5.0, 4.5, 0.0, 2.0, 1.0, 0.0), math.hypot(3.0, 3.5)),
        ((3.0, 0.0, math.pi / 4, 2.0, 2.0, 0.0), 2.0 - math.sqrt(2)),
        ((5.0, 4.5, 1.0, 0.0, 0.0, 0.5), math.hypot(4.0, 4.0) - 0.5),
        ((2.0, 0.0, 0.5 * math.pi, 3.0, 0.0, 0.4), 0.6),
        ((1.2, 0.0, 0.0, 0.0, 0.0, 0.4), -0.2),
    ],
)
def test_clearance_in_closed_form(b, expected):
    assert clearance((0.0, 0.0, 0.0, 2.0, 1.0, 0.0), b) == pytest.approx(expected)


def approach(a, b, velocity, time) -> float:
    return clearance((a[0] + time * velocity[0], a[1] + time * velocity[1], *a[2:]), b)


@given(a=rectangles, b=rectangles, vx=st.floats(-2, 2), vy=st.floats(-2, 2))
def test_contact_time_is_when_the_clearance_vanishes(a, b, vx, vy):
    time = contact_time(np.array(a, float), np.array(b, float), vx, vy)
    ahead = np.linspace(0.0, 20.0, 60)
    if math.isinf(time):
        assert min(approach(a, b, (vx, vy), t) for t in ahead) > -1e-6
        return
    assert approach(a, b, (vx, vy), time) <= 1e-6
    if time > 0.0:
        earlier = time * ahead / 20.001
        assert all(approach(a, b, (vx, vy), t) > -1e-6 for t in earlier)


def test_contact_time_in_numbers():
    """Faces 3 m apart at 0.5 m/s; 45 deg later the corner comes first."""
    a, b = np.array([0, 0, 0, 1.0, 1.0, 0]), np.array([4.0, 0, 0, 1.0, 1.0, 0])
    assert contact_time(a, b, 0.5, 0.0) == pytest.approx(6.0)
    assert math.isinf(contact_time(a, b, -0.5, 0.0))
    assert math.isinf(contact_time(a, b, 0.0, 0.0))
    a[2] = math.pi / 4
    assert contact_time(a, b, 0.5, 0.0) == pytest.approx((3.5 - math.sqrt(0.5)) / 0.5)
    assert contact_time(b, b, 0.5, 0.0) == 0.0


def test_contact_time_with_a_disc_in_numbers():
    """A disc of 0.3 m passes a box at an offset of 0.7 m, and touches its corner."""
    a, b = np.array([0, 0.7, 1.0, 0, 0, 0.3]), np.array([4.0, 0, 0, 1.0, 1.0, 0])
    ahead = 3.5 - math.sqrt(0.3**2 - 0.2**2)
    assert contact_time(a, b, 0.5, 0.0) == pytest.approx(ahead / 0.5)
    a[1] = 0.8 + 1e-9
    assert math.isinf(contact_time(a, b, 0.5, 0.0))


def test_cone_range_of_a_disc_in_closed_form():
    """Law of cosines along the side of the cone that is nearer to the center."""
    half_angle, far, r = math.radians(10), 2.0, 0.4
    for off_deg in (0.0, 9.0, -18.0, 21.0, 21.6):
        beside = max(math.radians(abs(off_deg) - 10), 0.0)
        roots = np.roots([1.0, -2.0 * far * math.cos(beside), far**2 - r**2])
        expected = min(roots.real) if np.isreal(roots).all() else math.inf
        off = math.radians(off_deg)
        disc = (far * math.cos(off), far * math.sin(off), 0.3, 0.0, 0.0, r)
        measured = seen(0.0, 0.0, 0.0, half_angle, [disc])
        assert measured == pytest.approx(expected, abs=1e-9)
    assert seen(far, 0.0, 0.0, half_angle, [(1.7, 0.0, 0.3, 0.0, 0.0, r)]) == 0.0


def depths(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n,) how deep (n, 6) rectangles overlap, by the shadows of all corners."""
    signs = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) / 2.0
    corners = []
    for each in (a, b):
        turn = np.exp(1j * each[:, 2])[:, None]
        local = each[:, None, 3] * signs[:, 0] + 1j * each[:, None, 4] * signs[:, 1]
        corners.append((each[:, 0] + 1j * each[:, 1])[:, None] + turn * local)
    depth = np.full(len(a), np.inf)
    for each in (a, b):
        for quarter in (0.0, math.pi / 2):
            back = np.exp(-1j * (each[:, 2] + quarter))[:, None]
            one, other = ((back * corner).real for corner in corners)
            shadow = np.minimum(one.max(1) - other.min(1), other.max(1) - one.min(1))
            depth = np.minimum(depth, shadow)
    return depth


def test_first_overlap_against_a_dense_search():
    """Bodies of 3 mm to 1 m that go up to 3 m and turn up to 2 rad within a step."""
    rng = np.random.default_rng(5)
    hits = passes = misses = 0
    dense = np.linspace(0.0, 1.0, 4_001)
    for _ in range(300):
        sizes = np.pad(10.0 ** rng.uniform(-2.5, 0.0, (2, 2)), ((0, 0), (0, 1)))
        before, now = rng.uniform(-1.0, 1.0, (2, 3))
        parts = int(rng.choice([1, 5]))
        poses = rng.uniform(-1.0, 1.0, (1, 3)) + np.cumsum(
            rng.uniform(-1.0, 1.0, (parts + 1, 3)) / parts, axis=0
        )
        at = np.linspace(0.0, 1.0, parts + 1)
        mine = before + dense[:, None] * (now - before)
        other = np.column_stack([np.interp(dense, at, column) for column in poses.T])
        deep = depths(
            np.column_stack([mine, np.tile(sizes[0], (len(dense), 1))]),
            np.column_stack([other, np.tile(sizes[1], (len(dense), 1))]),
        )
        found = first_overlap(before, now, sizes[0], poses, sizes[1])
        if deep[0] > 0.0:
            continue
        if math.isinf(found):
            assert deep.max() < 1e-4
            misses += 1
            continue
        hits += 1
        # From one dense instant to the next no point goes farther than 2 mm.
        assert deep[round(found * 4_000)] > -2e-3
        first = dense[deep > 1e-4][0] if deep.max() > 1e-4 else found
        assert found <= math.ceil(parts * first) / parts
        passes += int(np.all(deep[::800] <= 0.0))
    assert hits > 40
    assert passes > 15, "found between fifths"
    assert misses > 100


def test_first_overlap_of_what_turns_by_a_whole_number_of_turns():
    """The heading of a path jumps by 2 pi from one of its legs to the next."""
    poses = np.array([[1.0, 0.0, math.pi], [1.0, 0.0, -math.pi]])
    still = np.zeros(3)
    assert math.isinf(
        first_overlap(still, still, (1.0, 1.0, 0.0), poses, (0.2, 2.0, 0.0))
    )
    poses[1, 0] = 0.55
    assert first_overlap(still, still, (1.0, 1.0, 0.0), poses, (0.2, 2.0, 0.0)) == 1.0


def test_first_overlap_with_discs_against_a_dense_search():
    """Discs of 30 to 300 mm that pass walls of 40 mm, which turn, within a step."""
    rng = np.random.default_rng(6)
    dense = np.linspace(0.0, 1.0, 2_001)
    hits = misses = 0
    for _ in range(100):
        disc, wall = (0.0, 0.0, rng.uniform(0.03, 0.3)), (0.5, 0.0, 0.02)
        before, now = rng.uniform(-1.0, 1.0, (2, 3))
        poses = rng.uniform(-0.5, 0.5, (2, 3))
        mine = before + dense[:, None] * (now - before)
        other = poses[0] + dense[:, None] * (poses[1] - poses[0])
        # The distance of the center of the disc from the middle line of the wall.
        c, s = np.cos(other[:, 2]), np.sin(other[:, 2])
        dx, dy = (mine - other)[:, :2].T
        along = np.maximum(np.abs(c * dx + s * dy) - 0.25, 0.0)
        gap = np.hypot(along, c * dy - s * dx) - disc[2] - wall[2]
        found = first_overlap(before, now, disc, poses, wall)
        if gap[0] <= 0.0:
            continue
        if math.isinf(found):
            assert gap.min() > -1e-4
            misses += 1
            continue
        hits += 1
        # A shallow touch before may have been missed, up to 0.1 mm.
        assert gap[math.ceil(found * 2_000)] < 2e-3
        deep = np.flatnonzero(gap < -1e-4)
        assert not len(deep) or found <= 1.0
        assert len(poses) == 2
        assert found == 1.0 or gap[: math.floor(found * 2_000)].min() > -2e-4
    assert hits > 20
    assert misses > 20
