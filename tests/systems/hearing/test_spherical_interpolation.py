"""Spherical interpolation: exact on exact differences, and never turned round."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from systems.hearing.spherical_interpolation import (
    interpolate_sphere,
    near_or_far,
    plane_wave_bearing,
)

ARM = 0.15
Y = ARM * np.array([[1.0, 0.0], [-0.5, math.sqrt(0.75)], [-0.5, -math.sqrt(0.75)]])
SAMPLE_M = 340.0 / 32_000.0


def differences(x, y, z=0.0):
    ways = np.sqrt(((np.array([x, y]) - Y) ** 2).sum(axis=1) + z * z)
    return ways - math.sqrt(x * x + y * y + z * z)


def y_array_source(arm, d):
    """Closed form of eq. 17 for a Y, by hand: (x, y) and range."""
    total = sum(d)
    distance = (3.0 * arm**2 - sum(each**2 for each in d)) / (2.0 * total)
    half = [0.5 * (arm**2 - each**2) - distance * each for each in d]
    x = 2.0 / (3.0 * arm) * (half[0] - 0.5 * (half[1] + half[2]))
    return x, 2.0 / (3.0 * arm) * math.sqrt(0.75) * (half[1] - half[2]), distance


@given(st.floats(0.3, 3.0), st.floats(-math.pi, math.pi))
def test_in_the_plane_it_is_exact(distance, bearing):
    x, y = distance * math.cos(bearing), distance * math.sin(bearing)
    place, found = interpolate_sphere(Y, differences(x, y))
    assert (*place, found) == pytest.approx((x, y, distance), abs=1e-9)
    assert y_array_source(ARM, differences(x, y)) == pytest.approx(
        (x, y, distance), abs=1e-9
    )


@given(st.floats(0.4, 2.5), st.floats(-math.pi, math.pi), st.floats(0.0, 0.4))
def test_of_a_raised_source_it_is_the_place_below(distance, bearing, z):
    x, y = distance * math.cos(bearing), distance * math.sin(bearing)
    place, found = interpolate_sphere(Y, differences(x, y, z))
    assert (*place, found) == pytest.approx((x, y, math.hypot(distance, z)), abs=1e-9)


def test_five_microphones_are_solved_as_least_squares():
    """Against scipy's own minimum of the equation's error (Song 2011, eq. 16)."""
    from scipy.optimize import least_squares

    places = np.array([[0.2, 0.0], [0.0, 0.2], [-0.2, 0.0], [0.0, -0.2], [0.15, 0.15]])
    source, generator = np.array([0.9, 0.5]), np.random.default_rng(2)
    d = np.linalg.norm(source - places, axis=1) - np.linalg.norm(source)
    d += 1e-3 * generator.standard_normal(5)
    delta = (places**2).sum(axis=1) - d * d

    def error(unknown):
        return delta - 2.0 * unknown[2] * d - 2.0 * places @ unknown[:2]

    expected = least_squares(error, [1.0, 0.0, 1.0]).x
    place, found = interpolate_sphere(places, d)
    # Eq. 17 first fits the place to a range, then the range: the same minimum.
    assert (*place, found) == pytest.approx(expected, rel=1e-6)


@given(
    st.floats(0.5, 3.0),
    st.floats(-math.pi, math.pi),
    st.tuples(*[st.floats(-0.5, 0.5)] * 3),
)
def test_half_a_sample_never_turns_it_round(distance, bearing, errors):
    x, y = distance * math.cos(bearing), distance * math.sin(bearing)
    d = differences(x, y) + SAMPLE_M * np.array(errors)
    off = math.remainder(near_or_far(Y, d)[0] - bearing, 2.0 * math.pi)
    assert abs(math.degrees(off)) < 5.0


def test_alone_it_does_turn_round():
    """The printed chain: a wrong sign of the sum of the differences."""
    d = differences(2.5, 0.0) - SAMPLE_M / 3.0
    place, found = interpolate_sphere(Y, d)
    assert found < 0.0
    assert place[0] < 0.0
    assert abs(near_or_far(Y, d)[0]) < math.radians(1.0)
    assert near_or_far(Y, d)[1] is None


@pytest.mark.parametrize(
    ("distance", "most_deg"), [(0.25, 9.0), (1.0, 2.5), (2.5, 1.0)]
)
def test_a_plane_wave_is_a_little_off_near_by(distance, most_deg):
    worst = max(
        abs(
            math.remainder(
                plane_wave_bearing(
                    Y, differences(distance * math.cos(b), distance * math.sin(b))
                )
                - b,
                2.0 * math.pi,
            )
        )
        for b in np.linspace(-math.pi, math.pi, 73)
    )
    assert math.degrees(worst) < most_deg
