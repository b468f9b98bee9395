"""Directions from delays of plane waves."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.optimize import least_squares

from analysis.arrays.far_field import locate_far_source
from systems.sound.array_shape import ArrayShape

C = 340.0
SQUARE = [[0.05, 0.05], [-0.05, 0.05], [-0.05, -0.05], [0.05, -0.05]]
SPACE = [[0.1, 0.1, 0.1], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.12], [0.2, 0.1, 0.05]]
SHAPES = {
    "row": ArrayShape.of([[0.0, 0.4], [0.0, 0.1], [0.0, -0.4]]),
    "flat": ArrayShape.of(SQUARE),
    "level": ArrayShape.of([[*p, 0.0] for p in SQUARE]),
    "space": ArrayShape.of(SPACE),
}


def delays(shape, u):
    return (shape.p_AM[0] - shape.p_AM[1:]) @ u / C


def unit(bearing, elevation, dimension):
    level = math.cos(elevation)
    whole = [level * math.cos(bearing), level * math.sin(bearing), math.sin(elevation)]
    return np.array(whole[:dimension])


@given(st.sampled_from(sorted(SHAPES)), st.floats(-1.4, 1.4), st.floats(0.2, 1.3))
def test_exact_delays_give_the_direction(name, bearing, elevation):
    shape = SHAPES[name]
    elevation = elevation if shape.dimension == 3 else 0.0
    u = unit(bearing, elevation, shape.dimension)
    size = shape.count - 1
    fix = locate_far_source(delays(shape, u), 1e-12 * np.eye(size), shape, C)
    np.testing.assert_allclose(fix.p_AS, u, atol=1e-7)
    assert fix.bearing == pytest.approx(bearing, abs=1e-6)
    if shape.dimension == 3:
        assert fix.elevation == pytest.approx(elevation, abs=1e-6)
    else:
        assert fix.elevation is None
    assert not fix.range_valid
    assert fix.chi_square < 1e-6


@pytest.mark.parametrize("name", sorted(SHAPES))
def test_errors_are_those_of_many_trials(name):
    shape = SHAPES[name]
    rng = np.random.default_rng(4)
    elevation = 0.7 if shape.dimension == 3 else 0.0
    u = unit(0.5, elevation, shape.dimension)
    size = shape.count - 1
    covariance = 1e-13 * (np.eye(size) + np.ones((size, size)))
    root = np.linalg.cholesky(covariance)
    tau = delays(shape, u)
    fixes = [
        locate_far_source(tau + root @ rng.standard_normal(size), covariance, shape, C)
        for _ in range(1000)
    ]
    # 1000 trials know a standard deviation to 2.2 %.
    assert fixes[0].bearing_std == pytest.approx(
        np.std([f.bearing for f in fixes]), rel=0.08
    )
    if elevation:
        assert fixes[0].elevation_std == pytest.approx(
            np.std([f.elevation or math.nan for f in fixes]), rel=0.08
        )
    freedom = size - len(shape.span) + (shape.ahead is None)
    assert np.mean([f.chi_square for f in fixes]) == pytest.approx(
        freedom, abs=0.15 * max(freedom, 0.1)
    )


@pytest.mark.parametrize("name", ["row", "space"])
def test_errors_of_curved_waves_taken_for_plane_ones(name):
    """Sources whose inverse ranges have the stated deviation; next to no noise."""
    shape = SHAPES[name]
    rng = np.random.default_rng(5)
    elevation = 0.7 if shape.dimension == 3 else 0.0
    u = unit(0.5, elevation, shape.dimension)
    size = shape.count - 1
    # Errors this large hide the curvature, so that all of it must be counted.
    covariance = 1e-6 * (np.eye(size) + 1.0)
    errors = []
    for w in 0.05 * rng.standard_normal(400):
        ranges = np.linalg.norm(u / abs(w) - shape.p_AM, axis=1)
        # A negative inverse range: the same curvature the other way round.
        curved = (ranges[1:] - ranges[0]) / C - delays(shape, u)
        tau = delays(shape, u) + math.copysign(1.0, w) * curved
        fix = locate_far_source(tau, covariance, shape, C)
        errors.append(fix.bearing - 0.5)
    plane = locate_far_source(delays(shape, u), covariance, shape, C)
    bent = locate_far_source(
        delays(shape, u), covariance, shape, C, inverse_range_std=0.05
    )
    added = math.sqrt(bent.bearing_std**2 - plane.bearing_std**2)
    assert added == pytest.approx(np.std(errors), rel=0.12)


def test_curvature_that_would_be_seen_is_not_counted():
    """Exact delays of five microphones in space leave no room for a curvature."""
    shape = SHAPES["space"]
    u = unit(0.5, 0.7, 3)
    covariance = 1e-16 * (np.eye(4) + 1.0)
    plane, bent = (
        locate_far_source(
            delays(shape, u), covariance, shape, C, inverse_range_std=sigma
        )
        for sigma in (0.0, 1.0)
    )
    assert bent.bearing_std < 3.0 * plane.bearing_std


def test_same_as_a_general_least_squares():
    shape = SHAPES["space"]
    rng = np.random.default_rng(7)
    size = shape.count - 1
    mixed = rng.standard_normal((size, size))
    covariance = 1e-12 * (mixed @ mixed.T + np.eye(size))
    tau = delays(shape, unit(1.0, 0.3, 3)) + 2e-5 * rng.standard_normal(size)
    whitened = np.linalg.inv(np.linalg.cholesky(covariance))

    def residuals(angles):
        return whitened @ (tau - delays(shape, unit(angles[0], angles[1], 3)))

    expected = least_squares(residuals, [0.9, 0.2], xtol=1e-14, ftol=1e-14)
    fix = locate_far_source(tau, covariance, shape, C)
    assert [fix.bearing, fix.elevation] == pytest.approx(expected.x, abs=1e-5)
    assert fix.chi_square == pytest.approx(2.0 * expected.cost, rel=1e-6)


def test_tolerance_weighs_but_is_no_error():
    """A tolerance of the delays' length turns no direction of a round array."""
    shape = SHAPES["flat"]
    tau = 0.9 * delays(shape, unit(0.4, 0.0, 2))
    covariance = 1e-14 * (np.eye(3) + 1.0)
    strict = locate_far_source(tau, covariance, shape, C)
    lenient = locate_far_source(
        tau, covariance, shape, C, tolerance=0.1**2 * np.outer(tau, tau)
    )
    assert lenient.bearing == pytest.approx(0.4, abs=1e-6)
    assert lenient.bearing_std == pytest.approx(strict.bearing_std, rel=0.2)
    assert lenient.chi_square < 2.0 < strict.chi_square


def test_delays_longer_than_the_array_lie_along_it():
    fix = locate_far_source(
        1.05 * delays(SHAPES["row"], np.array([0.0, 1.0])),
        1e-12 * (np.eye(2) + 1.0),
        SHAPES["row"],
        C,
    )
    assert fix.bearing == pytest.approx(math.pi / 2)
    level = locate_far_source(
        1.05 * delays(SHAPES["level"], unit(2.0, 0.0, 3)),
        1e-12 * (np.eye(3) + 1.0),
        SHAPES["level"],
        C,
    )
    assert (level.bearing, level.elevation) == pytest.approx((2.0, 0.0))
    assert level.elevation_std is not None
    assert math.isfinite(level.elevation_std)
