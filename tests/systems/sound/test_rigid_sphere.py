"""Sound on a rigid sphere, against the total field and against known limits."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.special import eval_legendre, spherical_jn, spherical_yn

from systems.sound.rigid_sphere import RigidSphere, surface_pressure

A, C = 0.042, 343.0


def total_field(ka, ratio, angle):
    """Pressure of incident and scattered wave at the distance ``ratio`` a."""
    n = np.arange(40)[:, np.newaxis]

    def h(x, derivative=False):
        return spherical_jn(n, x, derivative=derivative) + 1j * spherical_yn(
            n, x, derivative=derivative
        )

    scattered = spherical_jn(n, ka, derivative=True) / h(ka, derivative=True)
    radial = spherical_jn(n, ka * ratio) - scattered * h(ka * ratio)
    waves = 1j**n * (2 * n + 1) * radial
    return np.sum(waves * eval_legendre(n, -np.cos(angle)), axis=0)


@pytest.mark.parametrize("ka", [0.5, 2.0, 6.0])
def test_the_pressure_on_the_surface_is_that_of_the_total_field(ka):
    angle = np.linspace(0.0, math.pi, 7)
    found = surface_pressure(np.array([ka]), angle)[0]
    np.testing.assert_allclose(found, total_field(ka, 1.0, angle), rtol=1e-6)
    # The sphere is rigid: the pressure does not change along the normal.
    step = 1e-5
    near = total_field(ka, 1.0 + step, angle)
    assert np.abs(near - found).max() < 1e-6


def test_far_away_the_wave_is_that_of_free_air():
    """The convention of the phase: it grows with the arrival time."""
    angle = np.array([0.0, math.pi / 3])
    phase = np.angle(total_field(0.05, 30.0, angle))
    np.testing.assert_allclose(phase, -0.05 * 30.0 * np.cos(angle), atol=0.01)


def test_low_frequencies_are_later_by_half():
    sphere = RigidSphere(np.eye(3), A, (20.0, 100.0), C)
    assert sphere.scale == pytest.approx(1.5, abs=0.01)
    assert sphere.bend_std_m < 0.01 * A
    assert sphere.scale_std < 0.01


def test_high_frequencies_creep_around_the_sphere():
    """Straight rays on the lit side, and the path along the surface behind it."""
    angle = np.radians([0.0, 40.0, 80.0, 110.0, 135.0])
    toward = np.stack((np.cos(angle), np.sin(angle)), axis=1)
    sphere = RigidSphere(toward, A, (60e3, 90e3), C)
    u = np.array([1.0, 0.0])
    arrival = sphere.later(u) * C / A - sphere.scale * np.cos(angle)
    expected = np.where(angle < math.pi / 2, -np.cos(angle), angle - math.pi / 2)
    np.testing.assert_allclose(arrival, expected, atol=0.06)


def test_delays_lie_between_the_limits():
    for band in ((300.0, 4000.0), (300.0, 8000.0), (1000.0, 15_000.0)):
        sphere = RigidSphere(np.eye(3), A, band, C)
        assert 1.15 < sphere.scale < 1.55
        u = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
        arrival = sphere.later(u) * C / A - sphere.scale * u
        assert np.all(np.abs(arrival) < 1.65)
        assert arrival[0, 2] < -1.0
        assert arrival[1, 2] > 1.5


def test_a_large_sphere_at_high_frequencies_has_finite_delays():
    sphere = RigidSphere(np.eye(3), 0.4, (300.0, 15_000.0), C)
    u = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
    assert np.isfinite(sphere.later(u)).all()
    assert sphere.scale == pytest.approx(1.15, abs=0.1)
