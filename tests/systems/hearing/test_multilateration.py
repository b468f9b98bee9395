"""Sources from delays: exact ones, noisy ones, and what cannot be told."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.optimize import least_squares

from systems.hearing import near_field
from systems.hearing.multilateration import locate_source
from systems.sound.array_shape import ArrayShape, EqualRow

C = 340.0
seeds = st.integers(0, 2**32 - 1)


def delays(shape, p_AS):
    ranges = np.linalg.norm(shape.p_AM - p_AS, axis=1)
    return (ranges[1:] - ranges[0]) / C


def noise_of(count, std):
    """Covariance of delays against a channel of arrival times that err by std."""
    return std**2 * (np.eye(count - 1) + 1.0)


def circle(count, radius=0.1):
    angles = np.arange(count) * 2 * math.pi / count
    return radius * np.stack((np.cos(angles), np.sin(angles)), axis=1)


def flat(places):
    return np.column_stack((places, np.zeros(len(places))))


#: Arrays of every kind, and a place that each can tell.
CASES = {
    "uneven row": ([[0, 0.4], [0, 0.1], [0, -0.4]], (1.4, 0.9)),
    "row of four": ([[0, 0.3], [0, 0.1], [0.0, 0.0], [0, -0.4]], (1.4, -0.6)),
    "row in space": ([[0.3, 0, 1], [0.1, 0, 1], [-0.2, 0, 1]], (0.4, 1.2, 0.0)),
    "triangle": ([[0, 0.3], [0.25, -0.1], [-0.25, -0.1]], (-1.0, 0.8)),
    "circle": (circle(6, 0.2), (0.5, -1.1)),
    "circle in space": (flat(circle(6, 0.2)), (0.8, 0.3, 0.5)),
    "tetrahedron": ([[0.2] * 3, [0.2, -0.2, -0.2], [-0.2, 0.2, -0.2],
                     [-0.2, -0.2, 0.2]], (1.0, -0.7, -0.4)),
    "five in space": ([[0, 0, 0.3], [0.3, 0, 0], [0, 0.3, 0], [-0.3, 0, 0],
                       [0, -0.2, -0.2]], (-0.9, 0.5, 0.7)),
}  # fmt: skip
cases = pytest.mark.parametrize("name", CASES)


def case(name):
    places, p_AS = CASES[name]
    return ArrayShape.of(places), np.array(p_AS)


@given(seeds, st.integers(5, 8), st.sampled_from(["row", "plane", "flat", "space"]))
def test_exact_delays_give_the_place(seed, count, kind):
    generator = np.random.default_rng(seed)
    # One microphone in each cell of a grid, so that the array spans its space.
    dimension = 3 if kind in ("flat", "space") else 2
    corners = np.array([[-1, -1, -1], [1, 1, -1], [-1, 1, 1], [1, -1, 1],
                        [-1, 1, -1], [1, -1, -1], [-1, -1, 1], [1, 1, 1]])  # fmt: skip
    p = 0.2 * corners[:count, :dimension] + generator.uniform(
        -0.05, 0.05, (count, dimension)
    )
    if kind == "row":
        p[:, 0] = 0.0
        p[:, 1] = 0.1 * np.arange(count) + generator.uniform(-0.04, 0.04, count)
    if kind == "flat":
        p[:, 2] = 0.0
    shape = ArrayShape.of(p)
    angle = generator.uniform(-1.3, 1.3)
    height = generator.uniform(0.2, 1.2)
    p_AS = generator.uniform(0.6, 4.0) * np.array(
        [math.cos(angle), math.sin(angle), math.sin(height)]
    )
    p_AS = p_AS[:dimension]
    fix = locate_source(delays(shape, p_AS), noise_of(count, 1e-12), shape, C)
    assert fix.range_valid
    close = pytest.approx(p_AS, abs=1e-6)
    assert close == fix.p_AS or (fix.twin is not None and close == fix.twin)


@cases
def test_every_kind_of_array_finds_its_source(name):
    shape, p_AS = case(name)
    fix = locate_source(delays(shape, p_AS), noise_of(shape.count, 1e-8), shape, C)
    assert fix.p_AS == pytest.approx(p_AS, abs=1e-6)
    assert fix.range == pytest.approx(np.linalg.norm(p_AS))
    assert fix.bearing == pytest.approx(math.atan2(p_AS[1], p_AS[0]))
    if fix.elevation is not None:
        assert math.sin(fix.elevation) == pytest.approx(p_AS[2] / fix.range)
    assert fix.chi_square == pytest.approx(0.0, abs=1e-6)
    mirrored = fix.mirrored(shape)
    assert (mirrored is None) == (shape.ambiguity == "none")
    if mirrored is not None:
        assert delays(shape, mirrored.p_AS) == pytest.approx(delays(shape, p_AS))
        assert mirrored.p_AS != pytest.approx(p_AS)


@cases
def test_agrees_with_scipy_and_its_covariance(name):
    """Against least squares over the position by another solver."""
    shape, p_AS = case(name)
    generator = np.random.default_rng(5)
    mixing = generator.uniform(-1e-7, 1e-7, (shape.count - 1, shape.count - 1))
    covariance = mixing @ mixing.T + noise_of(shape.count, 1e-7)
    tau = delays(shape, p_AS) + generator.multivariate_normal(
        np.zeros(shape.count - 1), covariance
    )
    fix = locate_source(tau, covariance, shape, C)
    root = np.linalg.inv(np.linalg.cholesky(covariance))
    # A row in space hears nothing of what happens across its half plane.
    axes = np.eye(shape.dimension)
    if shape.kind == "row":
        assert shape.ahead is not None
        axes = np.stack((shape.ahead, shape.span[0]), axis=1)

    def residuals(x):
        return root @ (delays(shape, axes @ x) - tau)

    other = least_squares(residuals, axes.T @ p_AS, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    assert fix.p_AS == pytest.approx(axes @ other.x, abs=1e-5)
    assert fix.chi_square == pytest.approx(2.0 * other.cost, abs=1e-6)
    expected = axes @ np.linalg.inv(other.jac.T @ other.jac) @ axes.T
    np.testing.assert_allclose(
        fix.covariance, expected, rtol=2e-3, atol=2e-3 * np.abs(expected).max()
    )
    step = 1e-6
    for value, std in ((0, fix.bearing_std), (1, fix.range_std)):

        def at(x, value=value):
            return (math.atan2(x[1], x[0]), float(np.linalg.norm(x)))[value]

        gradient = [
            (at(fix.p_AS + step * e) - at(fix.p_AS - step * e)) / (2 * step)
            for e in np.eye(shape.dimension)
        ]
        assert std == pytest.approx(math.sqrt(gradient @ expected @ gradient), rel=5e-3)


def test_a_range_that_is_hardly_known_is_that_of_least_squares_too():
    """0.5 m, and nearly as much its standard deviation: by another solver."""
    shape, p_AS = case("circle")[0], np.array([0.3, -0.4])
    covariance = noise_of(6, 1e-4)
    generator = np.random.default_rng(2)
    tau = delays(shape, p_AS)
    tau = tau + 0.2 * generator.multivariate_normal(np.zeros(5), covariance)
    fix = locate_source(tau, covariance, shape, C)
    assert fix.range_valid
    assert fix.range_std > 0.6 * fix.range
    root = np.linalg.inv(np.linalg.cholesky(covariance))

    def residuals(x):
        return root @ (delays(shape, x) - tau)

    other = least_squares(residuals, p_AS, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    assert fix.p_AS == pytest.approx(other.x, abs=1e-6)


@cases
def test_stated_errors_are_the_actual_ones(name):
    """Normalized squares of the errors, and of the residuals, over 300 trials."""
    shape, p_AS = case(name)
    generator = np.random.default_rng(6)
    covariance = noise_of(shape.count, 2e-7)
    noise = generator.multivariate_normal(
        np.zeros(shape.count - 1), covariance, size=300
    )
    fixes = [
        locate_source(delays(shape, p_AS) + e, covariance, shape, C) for e in noise
    ]
    assert all(fix.range_valid for fix in fixes)
    errors = np.array([fix.p_AS - p_AS for fix in fixes])
    squares = [
        e @ np.linalg.pinv(f.covariance, rcond=1e-9) @ e
        for e, f in zip(errors, fixes, strict=True)
    ]
    unknowns = shape.unknowns
    # The mean of 300 chi-squares errs by sqrt(2 / (300 k)) of itself: 3.5 of them.
    margin = 3.5 * math.sqrt(2.0 / 300.0)
    assert np.mean(squares) == pytest.approx(unknowns, abs=margin * unknowns**0.5)
    chi_squares = [fix.chi_square for fix in fixes]
    assert np.mean(chi_squares) == pytest.approx(
        shape.freedom, abs=margin * max(shape.freedom, 0) ** 0.5 + 1e-6
    )


def test_the_three_in_a_row_closed_form_is_the_least_squares_solution():
    """A fourth microphone that hears nothing (a huge error) leaves three."""
    row = ArrayShape.of([[0, 0.4], [0.0, 0.0], [0, -0.4]])
    four = ArrayShape.of([[0, 0.4], [0.0, 0.0], [0, -0.4], [0, 0.7]])
    p_AS = np.array([1.5, 0.8])
    tau = delays(row, p_AS) + np.array([1e-7, -2e-7])
    covariance = np.array([[2.0, 0.7], [0.7, 3.0]]) * 1e-14
    fix = locate_source(tau, covariance, row, C)
    wide = np.diag([0.0, 0.0, 1.0])
    wide[:2, :2] = covariance
    center = four.p_AM[1]
    other = locate_source(np.array([*tau, 0.0]), wide, four, C)
    assert other.p_AS - center == pytest.approx(fix.p_AS, abs=1e-6)
    # Its covariance is that of the same place, seen from the same axes.
    np.testing.assert_allclose(other.covariance, fix.covariance, rtol=1e-3, atol=1e-9)


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 1, 0), (1, 2, 0), (1, 0, 2)])
@pytest.mark.parametrize("dimension", [2, 3])
def test_a_row_takes_any_order_of_channels(order, dimension):
    """A row along x: ahead is +y, and its left is -x."""
    places = np.array([[0.4, 0.0, 0.2], [0.0, 0.0, 0.2], [-0.4, 0.0, 0.2]])
    shape = ArrayShape.of(places[list(order), :dimension])
    p_AS = np.array([0.7, 1.2, 0.0])[:dimension]
    covariance = noise_of(3, 1e-7)
    fix = locate_source(delays(shape, p_AS), covariance, shape, C)
    assert fix.p_AS == pytest.approx(p_AS, abs=1e-9)
    assert fix.bearing == pytest.approx(math.atan2(1.2, 0.7))
    assert fix.elevation is None
    # Seen from the row, the source is on the right: 12 - 3 o'clock.
    times = -np.hypot(0.7 - np.array([-0.4, 0.0, 0.4]), 1.2) / C
    own = near_field.locate_in_row(
        times[0] - times[1:], covariance, EqualRow(0.4, np.eye(2), np.eye(2)), C
    )
    assert fix.range_std == pytest.approx(own.range_std)
    # Ahead and left of the row are +y and -x.
    turned = np.array([[0.0, -1.0], [1.0, 0.0]])
    expected = turned @ own.covariance @ turned.T
    np.testing.assert_allclose(fix.covariance[:2, :2], expected, rtol=1e-6)
    np.testing.assert_allclose(fix.covariance[2:], 0.0, atol=1e-20)


def test_far_sources_have_a_bearing_only():
    """At 30 m the row's delays differ from a plane wave's by 5 us, noise 10 us."""
    for places in (
        [[0, 0.4], [0.0, 0.0], [0, -0.4]],
        circle(4, 0.3),
        flat(circle(4, 0.3)),
    ):
        shape = ArrayShape.of(places)
        p_AS = 30.0 * np.array([math.cos(0.4), math.sin(0.4), 0.5])[: shape.dimension]
        fix = locate_source(delays(shape, p_AS), noise_of(shape.count, 1e-5), shape, C)
        assert not fix.range_valid
        assert (fix.range, fix.range_std) == (0.0, math.inf)
        assert np.linalg.norm(fix.p_AS) == pytest.approx(1.0)
        assert fix.bearing == pytest.approx(0.4, abs=0.01)
        # Nothing is known along the direction, and nothing claimed.
        assert fix.p_AS @ fix.covariance @ fix.p_AS == pytest.approx(0.0, abs=1e-12)


def test_three_in_space_tell_a_direction_but_no_range():
    shape = ArrayShape.of(flat(circle(3, 0.05)))
    p_AS = np.array([1.0, 1.0, 0.8])
    fix = locate_source(delays(shape, p_AS), noise_of(3, 1e-9), shape, C)
    assert not fix.range_valid
    assert fix.elevation is not None
    # Two apertures away counts as possible, and its curvature as an error.
    for value, std, true in (
        (fix.bearing, fix.bearing_std, math.pi / 4),
        (fix.elevation, fix.elevation_std, math.asin(0.8 / math.sqrt(2.64))),
    ):
        assert std is not None
        assert abs(value - true) < 2.0 * std < 0.2


def test_a_source_in_the_plane_of_an_array_has_an_honest_elevation():
    """Noise moves it out of what a plane array can hear, every second time."""
    shape = ArrayShape.of(flat(circle(4, 0.05)))
    u = np.array([math.cos(1.0), math.sin(1.0), 0.0])
    covariance = noise_of(4, 1e-6)
    generator = np.random.default_rng(8)
    elevations, ratios = [], []
    for _ in range(200):
        tau = -(shape.p_AM[1:] - shape.p_AM[0]) @ u / C
        tau = tau + generator.multivariate_normal(np.zeros(3), covariance)
        fix = locate_source(tau, covariance, shape, C)
        assert fix.elevation is not None
        assert fix.elevation_std is not None
        assert fix.elevation >= -1e-12
        assert math.cos(fix.bearing - 1.0) > 0.99
        elevations.append(fix.elevation)
        ratios.append(fix.elevation / fix.elevation_std)
    assert 0.3 < math.sqrt(np.mean(np.square(ratios))) < 2.0
    assert max(elevations) < 0.3


def test_a_slanted_row_claims_no_azimuth():
    upright = ArrayShape.of([[0, 0, 0.1], [0, 0, 0.25], [0, 0, 0.6]])
    p_AS = np.array([0.0, 1.0, 0.5])
    fix = locate_source(delays(upright, p_AS), noise_of(3, 1e-8), upright, C)
    assert fix.bearing_std == math.inf
    assert fix.elevation == pytest.approx(math.atan2(0.5, 1.0))
    assert fix.elevation_std is not None
    assert fix.elevation_std < 0.01
    slanted = ArrayShape.of([[0.0, 0.0, 0.0], [0.1, 0.0, 0.1], [0.3, 0, 0.3]])
    fix = locate_source(delays(slanted, p_AS), noise_of(3, 1e-8), slanted, C)
    assert (fix.bearing_std, fix.elevation_std) == (math.inf, math.inf)


def test_two_places_with_the_same_delays_are_both_told():
    """Three microphones in the plane, a source behind a corner of theirs."""
    shape = ArrayShape.of([[0, 0.3], [0.25, -0.1], [-0.25, -0.1]])
    generator = np.random.default_rng(3)
    told = 0
    for _ in range(200):
        p_AS = generator.uniform(-0.8, 0.8, 2)
        fix = locate_source(delays(shape, p_AS), noise_of(3, 1e-10), shape, C)
        if fix.twin is None:
            assert fix.p_AS == pytest.approx(p_AS, abs=1e-6)
            continue
        told += 1
        assert delays(shape, fix.twin) == pytest.approx(delays(shape, p_AS), abs=1e-12)
        assert min(np.abs(fix.p_AS - p_AS).max(), np.abs(fix.twin - p_AS).max()) < 1e-6
    assert told >= 10


def test_swapped_channels_show_in_the_chi_square():
    shape, p_AS = case("circle")
    tau = delays(shape, p_AS)
    swapped = tau[[1, 0, 2, 3, 4]]
    covariance = noise_of(6, 1e-6)
    assert locate_source(swapped, covariance, shape, C).chi_square > 100.0


@given(seeds, st.sampled_from(sorted(CASES)))
def test_always_finite(seed, name):
    """Whatever the delays, up to half as long again as sound can take."""
    shape, _ = case(name)
    generator = np.random.default_rng(seed)
    limit = 1.5 * shape.max_delay(C)
    tau = generator.uniform(-limit, limit, shape.count - 1)
    fix = locate_source(tau, noise_of(shape.count, 1e-6), shape, C)
    assert np.isfinite([fix.bearing, fix.range, fix.chi_square]).all()
    assert np.isfinite(fix.bearing_std)
    assert np.isfinite(fix.p_AS).all()
    assert np.isfinite(fix.covariance).all()
    assert fix.range_valid == (fix.range > 0.0) == math.isfinite(fix.range_std)
    assert fix.range_std > fix.range or fix.range_valid
    if shape.ahead is not None:
        assert fix.p_AS @ shape.ahead >= -1e-9


def test_a_source_fix_without_range_keeps_its_direction():
    shape, p_AS = case("five in space")
    fix = locate_source(delays(shape, p_AS), noise_of(5, 1e-7), shape, C)
    alone = fix.without_range()
    assert alone.p_AS == pytest.approx(p_AS / np.linalg.norm(p_AS))
    assert (alone.bearing, alone.elevation) == (fix.bearing, fix.elevation)
    assert alone.p_AS @ alone.covariance @ alone.p_AS == pytest.approx(0.0, abs=1e-15)
    across = np.array([-math.sin(fix.bearing), math.cos(fix.bearing), 0.0])
    level = math.cos(alone.elevation or 0.0)
    assert across @ alone.covariance @ across == pytest.approx(
        (level * fix.bearing_std) ** 2
    )
    assert alone.without_range() is alone
