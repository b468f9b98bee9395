"""Steering at places: delays of the grid, the peak, and the next best direction."""

from __future__ import annotations

import math

import numpy as np
import pytest

from systems.hearing.steer_near import near_grid, steer

C, FINE_RATE = 340.0, 256_000.0
Y = 0.15 * np.array(
    [[0.0, 0.0], [1.0, 0.0], [-0.5, math.sqrt(0.75)], [-0.5, -math.sqrt(0.75)]]
)
PAIRS = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)]
GRID = near_grid(Y, PAIRS, C)


def correlations(*sources, width_s=2e-5):
    """Bells at the delays of places (distance, bearing, share)."""
    length = 4_096
    lags = np.fft.fftfreq(length, 1.0 / length) / FINE_RATE
    first, second = np.array(PAIRS).T
    total = np.zeros((len(PAIRS), length))
    for distance, bearing, share in sources:
        place = distance * np.array([math.cos(bearing), math.sin(bearing)])
        ways = np.linalg.norm(place - Y, axis=1)
        delays = (ways[second] - ways[first]) / C
        total += share * np.exp(-0.5 * ((lags - delays[:, None]) / width_s) ** 2)
    return total


def test_the_grid_holds_all_bearings_and_their_delays():
    """Ahead and far, the front arm hears first: by 0.15 m."""
    assert len(GRID.bearings) == 180
    ahead = int(np.abs(GRID.bearings).argmin())
    far = GRID.delays[0, -1, ahead]
    assert far == pytest.approx(-0.15 / C, rel=1e-9)
    left, right = GRID.delays[1, :, ahead], GRID.delays[2, :, ahead]
    np.testing.assert_allclose(left, right, atol=1e-15)


@pytest.mark.parametrize("distance", [0.4, 1.0, 2.5])
@pytest.mark.parametrize("bearing", [-3.1, -1.234, 0.01, 0.777, 2.5])
def test_it_finds_the_place_that_explains_all_delays(distance, bearing):
    found = steer(GRID, correlations((distance, bearing, 1.0)), FINE_RATE)
    off = math.remainder(found.bearing - bearing, math.tau)
    assert abs(math.degrees(off)) < 2.5
    assert found.response <= len(PAIRS)


def test_the_next_best_direction_has_its_share():
    one = correlations((1.0, 0.5, 1.0), width_s=4e-5)
    both = correlations((1.0, 0.5, 1.0), (1.0, -1.6, 0.8), width_s=4e-5)
    assert steer(GRID, one, FINE_RATE).other_share < 0.5
    found = steer(GRID, both, FINE_RATE)
    assert math.degrees(found.bearing) == pytest.approx(math.degrees(0.5), abs=4.0)
    assert math.degrees(found.other) == pytest.approx(math.degrees(-1.6), abs=4.0)
    assert found.other_share == pytest.approx(0.8, abs=0.15)


def test_nothing_has_no_direction_of_its_own():
    assert steer(GRID, np.zeros((6, 4_096)), FINE_RATE).other_share == 1.0
