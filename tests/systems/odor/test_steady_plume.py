"""The steady plume against quadrature of its integral, and its limits."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import erfcx, ndtr

from systems.odor.steady_plume import (
    scaled_erfc,
    steady_concentration,
)

DRAWS = 300


def by_quadrature(x, y, rate, speed, spreads):
    """Song 2011, eq. 1 on the floor, over s = 1 / t, in parts about the peak."""
    a, b, c = spreads
    far = (x / a) ** 2 + (y / b) ** 2
    peak = speed * x / a**2 / far
    width = 1.0 / math.sqrt(far)

    def density(s):
        cut = ((x * s - speed) / a) ** 2 + (y * s / b) ** 2
        return s * math.exp(-0.5 * cut)

    top = max(peak, 0.0) + 40.0 * width
    points = [p for p in (peak - 6 * width, peak, peak + 6 * width) if 0 < p < top]
    total = quad(density, 0.0, top, points=points, limit=400, epsabs=0)[0]
    return 2.0 * rate / ((2 * math.pi) ** 1.5 * a * b * c) * total


def sharan_concentration(x, y, rate, speed, intensities):
    """On the floor, with diffusivities that grow downwind (Sharan 1996).

    ``intensities``: sigma^2 / x^2 along the wind, across it, and upright.
    """
    alpha, beta, gamma = intensities
    factor = rate / (math.pi * speed * math.sqrt(beta * gamma) * x * x)
    off = y * y / beta / (x * x)
    return factor * (1.0 + alpha * off) ** (-1.0 - 0.5 / alpha)


def test_the_closed_form_is_the_integral():
    """Upwind, and for unequal spreads too."""
    generator = np.random.default_rng(3)
    for _ in range(DRAWS):
        x, y = generator.uniform(-2.0, 3.0), generator.uniform(-1.5, 1.5)
        speed = generator.uniform(0.3, 2.0)
        spreads = tuple(speed * generator.uniform(0.15, 0.6, 3))
        expected = by_quadrature(x, y, 2.0, speed, spreads)
        got = steady_concentration(x, y, 2.0, speed, spreads)
        assert got == pytest.approx(expected, rel=1e-10, abs=1e-300)


def test_on_the_floor_it_is_equation_6():
    for x, y in ((1.0, 0.0), (0.7, 0.4), (-0.3, 0.2)):
        u, g1, g2, r2 = 1.0, 0.27, 0.12, x * x + y * y
        s = u * x / (g1 * math.sqrt(r2))
        bracket = 1 + math.sqrt(2 * math.pi) * s * math.exp(s * s / 2) * ndtr(s)
        expected = 2 * math.exp(-u * u / (2 * g1 * g1)) / g2 / r2 * bracket
        expected /= (2 * math.pi) ** 1.5
        got = steady_concentration(x, y, 1.0, u, (g1, g1, g2))
        assert got == pytest.approx(expected, rel=1e-9)


def test_a_strong_wind_overflows_nothing():
    """u / gamma_1 = 100, where exp(s^2 / 2) is 10^2171: a Gaussian plume."""
    u, g = 1.0, 0.01
    got = steady_concentration(1.0, 0.005, 1.0, u, (g, g, g))
    sigma = g * 1.0 / u
    expected = math.exp(-0.5 * (0.005 / sigma) ** 2) / (math.pi * u * sigma * sigma)
    assert got == pytest.approx(expected, rel=2e-3)
    assert steady_concentration(-1.0, 0.0, 1.0, u, (g, g, g)) == 0.0


@pytest.mark.parametrize("strength", [1.5, 2.0, 4.0, 8.0])
def test_what_passes_is_what_is_released(strength):
    """The flux through x = const is Q Phi(u / a): puffs keep their own speed x / t.

    A weight of x / t in eq. 1 is u C + a^2 dC/du. u C alone has no finite integral.
    """
    a, b, c, x, rate = 0.3, 0.2, 0.15, 1.3, 2.0
    u, h = strength * a, 1e-4

    def at(off, speed):  # equal on ellipses of y / b and z / c
        return steady_concentration(x, off * b, rate, speed, (a, b, c))

    def ring(off):  # its half above the floor
        slope = (at(off, u + h) - at(off, u - h)) / (2.0 * h)
        return (u * at(off, u) + a * a * slope) * math.pi * b * c * off

    parts = (0.0, x / a, 10.0 * x / a, 1e3 * x / a, 1e5 * x / a)
    flux = sum(
        quad(ring, low, high, limit=400, epsabs=1e-9)[0]
        for low, high in itertools.pairwise(parts)
    )
    assert flux == pytest.approx(rate * ndtr(strength), rel=2e-5)


def test_sharan_is_near_it_within_two_sigma():
    i, gamma = 0.15, 0.12
    for x in (0.5, 1.0, 2.0):
        for off in (0.0, 1.0, 2.0):
            y = off * i * x
            first = steady_concentration(x, y, 1.0, 1.0, (i, i, gamma))
            second = sharan_concentration(x, y, 1.0, 1.0, (i * i, i * i, gamma**2))
            assert second == pytest.approx(first, rel=0.08)


def test_sharan_carries_all_of_it():
    alpha, beta, gamma, x, u = 0.02, 0.03, 0.02, 1.5, 0.8

    def ring(off):
        c = sharan_concentration(
            x, off * math.sqrt(beta) * x, 1.0, u, (alpha, beta, gamma)
        )
        # Half an ellipse above the floor, of equal off.
        return u * c * math.pi * off * math.sqrt(beta * gamma) * x * x

    assert quad(ring, 0.0, 60.0)[0] == pytest.approx(1.0, abs=1e-6)


def test_the_scaled_error_function_is_scipys():
    x = np.concatenate([np.linspace(0.0, 30.0, 2001), [100.0, 1e4, 1e8]])
    got = [scaled_erfc(each) for each in x]
    np.testing.assert_allclose(got, erfcx(x), rtol=1e-12)
