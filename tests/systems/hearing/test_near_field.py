"""The closed form for three microphones in a row, against geometry."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from systems.hearing.near_field import locate_in_row, source_from_delays
from systems.hearing.source_fix import NO_PLACE, PLANE_WAVE, RANGED
from systems.sound.array_shape import EqualRow

L, C = 0.4, 340.0
ROW = EqualRow(L, np.eye(2), np.eye(2))

bearings = st.floats(-80.0, 80.0).map(math.radians)
ranges = st.floats(0.1, 20.0)


def delays(bearing, distance):
    """tau_12, tau_13 of a source ahead, M1 at the left."""
    x, y = distance * math.cos(bearing), distance * math.sin(bearing)
    times = [math.hypot(x, y - place) / C for place in (L, 0.0, -L)]
    return times[1] - times[0], times[2] - times[0]


@given(bearings, ranges)
def test_inverts_the_geometry(bearing, distance):
    tau_12, tau_13 = delays(bearing, distance)
    found, found_range, status = source_from_delays(tau_12, tau_13, L, C)
    assert status == RANGED
    # Rounding of the delays is magnified by R^2 / (l cos)^2.
    magnified = 1.0 + (distance / (L * math.cos(bearing))) ** 2
    assert found == pytest.approx(bearing, abs=1e-12 * magnified)
    assert found_range == pytest.approx(distance, rel=1e-12 * magnified)


def test_left_is_positive():
    """M1 is at the left: it hears a source at the left first."""
    tau_12, tau_13 = delays(math.radians(30), 2.0)
    assert tau_12 > 0.0
    assert tau_13 > tau_12
    assert source_from_delays(tau_12, tau_13, L, C)[0] > 0.0


def test_channels_in_another_order():
    """M3, M1, M2: the delays are those of M1 and M2 less that of M3."""
    bearing, distance = 0.4, 1.5
    tau_12, tau_13 = delays(bearing, distance)
    row = EqualRow(L, np.array([[-1.0, 1.0], [-1.0, 0.0]]), np.eye(2))
    tau = np.array([-tau_13, tau_12 - tau_13])
    fix = locate_in_row(tau, 1e-16 * np.eye(2), row, C)
    assert fix.bearing == pytest.approx(bearing)
    assert fix.range == pytest.approx(distance)


def test_two_meters_broadside_in_numbers():
    """R1 = sqrt(4.16): a = 2 - R1, b = 0."""
    a = 2.0 - math.sqrt(4.16)
    bearing, distance, status = source_from_delays(a / C, 0.0, L, C)
    assert (bearing, status) == (0.0, RANGED)
    assert distance == pytest.approx(2.0, rel=1e-12)


@pytest.mark.parametrize(
    ("a", "b", "expected"),
    [
        (0.1, 0.2, PLANE_WAVE),  # b = 2 a
        (0.2, 0.3, PLANE_WAVE),  # b < 2 a: curved the wrong way
        (0.0, 0.9, NO_PLACE),  # longer than the array
        (-0.6, 0.2, NO_PLACE),  # R2 would be negative
    ],
)
def test_no_finite_range_means_bearing_only(a, b, expected):
    bearing, distance, status = source_from_delays(a / C, b / C, L, C)
    assert (distance, status) == (0.0, expected)
    assert bearing == pytest.approx(math.asin(min(1.0, b / (2 * L))))


@given(st.floats(-3e-3, 3e-3), st.floats(-3e-3, 3e-3))
def test_always_finite_and_in_front(tau_12, tau_13):
    fix = locate_in_row(np.array([tau_12, tau_13]), np.eye(2) * 1e-14, ROW, C)
    assert -math.pi / 2 <= fix.bearing <= math.pi / 2
    assert np.isfinite([*fix.p_AS, fix.range, fix.bearing_std]).all()
    assert np.isfinite(fix.covariance).all()
    assert fix.range >= 0.0
    assert fix.p_AS[0] >= 0.0


@given(st.floats(-70.0, 70.0).map(math.radians), st.floats(0.3, 6.0))
def test_covariance_is_first_order(bearing, distance):
    """Against differences of the closed form."""
    taus = np.array(delays(bearing, distance))
    covariance = np.array([[2.0, 0.7], [0.7, 3.0]]) * 1e-16
    fix = locate_in_row(taus, covariance, ROW, C)

    def position(tau):
        b, r, _ = source_from_delays(tau[0], tau[1], L, C)
        return np.array([r * math.cos(b), r * math.sin(b), b, r])

    step = 1e-10
    columns = [
        (position(taus + step * e) - position(taus - step * e)) / (2 * step)
        for e in np.eye(2)
    ]
    jacobian = np.stack(columns, axis=1)
    expected = jacobian @ covariance @ jacobian.T
    scale = np.abs(expected[:2, :2]).max()
    np.testing.assert_allclose(
        fix.covariance, expected[:2, :2], rtol=1e-3, atol=1e-4 * scale
    )
    assert fix.bearing_std == pytest.approx(math.sqrt(expected[2, 2]), rel=1e-3)
    assert fix.range_std == pytest.approx(math.sqrt(expected[3, 3]), rel=1e-3)


def test_range_error_of_one_sample_at_four_meters():
    """b - 2a ~ l^2 / R, so that dR = R^2 / l^2 d(b - 2a): 34 cm a sample."""
    fix = locate_in_row(np.array(delays(0.0, 4.0)), np.diag([1e-10, 0.0]), ROW, C)
    # A pure error of tau_12 enters b - 2a twice.
    assert fix.range_std == pytest.approx(2 * 16 / 0.16 * 3.4e-3, rel=0.02)


def test_bearing_alone_is_a_unit_vector():
    taus = np.array(delays(0.5, 2.0))
    fix = locate_in_row(taus, np.eye(2) * 1e-14, ROW, C).without_range()
    assert fix.p_AS == pytest.approx((math.cos(0.5), math.sin(0.5)))
    along = np.array(fix.p_AS)
    across = np.array([-along[1], along[0]])
    assert along @ fix.covariance @ along == pytest.approx(0.0, abs=1e-18)
    assert across @ fix.covariance @ across == pytest.approx(fix.bearing_std**2)
    assert (fix.range, fix.range_valid, fix.range_std) == (0.0, False, math.inf)


def test_errors_of_a_bearing_without_range_are_across_it():
    """A plane wave from the left; sin(bearing) = c tau_13 / 2 l."""
    tau_13 = 2.0 * L * math.sin(0.6) / C
    covariance = np.array([[2.0, 0.7], [0.7, 3.0]]) * 1e-16
    fix = locate_in_row(np.array([tau_13 / 2.0, tau_13]), covariance, ROW, C)
    assert not fix.range_valid
    assert fix.bearing == pytest.approx(0.6)
    std = C * math.sqrt(3e-16) / (2.0 * L * math.cos(0.6))
    across = np.array([-math.sin(0.6), math.cos(0.6)])
    assert fix.bearing_std == pytest.approx(std)
    np.testing.assert_allclose(fix.covariance, std**2 * np.outer(across, across))
