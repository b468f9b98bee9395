"""VFH+: its histograms and its choice, by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from systems.laws.baselines.vector_field_histogram_controller import (
    HistogramNumbers,
    choose_direction,
    polar_histogram,
)

NUMBERS = HistogramNumbers(1.5, 0.4, 1.0, 2.0)
#: mu_3 (paper: 2).
PREVIOUS = 2.0


def blocked(*spans):
    which = np.zeros(72, dtype=bool)
    for first, last in spans:
        which[[k % 72 for k in range(first, last + 1)]] = True
    return which


def test_a_cell_is_as_wide_as_the_robot():
    """asin(0.4/0.8) is 30 deg to both sides of 90 deg: sectors 12 to 24."""
    density = polar_histogram(np.array([[0.0, 0.8, 1.0]]), 0.0, 0.0, NUMBERS)
    assert [*np.flatnonzero(density)] == [*range(12, 25)]


def test_near_and_certain_cells_count_more():
    """c^2 (a - b d^2) with 10 at the robot and 1 at the window's edge (eq. 1)."""
    far, near, doubtful, beyond = (
        polar_histogram(np.array([[x, 0.0, c]]), 0.0, 0.0, NUMBERS).max()
        for x, c in ((1.5, 1.0), (0.75, 1.0), (0.75, 0.5), (1.6, 1.0))
    )
    assert far == pytest.approx(1.0)
    assert near == pytest.approx(10.0 - 9.0 / 4.0)
    assert doubtful == pytest.approx(near / 4.0)
    assert beyond == 0.0


def test_a_cell_within_the_robot_blocks_a_half():
    density = polar_histogram(np.array([[0.2, 0.0, 1.0]]), 0.0, 0.0, NUMBERS)
    assert np.count_nonzero(density) == 37


def test_nothing_blocked_is_straight_to_the_target():
    assert choose_direction(blocked(), 10.0, 0.0, -1.0, PREVIOUS) == 10.0


def test_all_blocked():
    assert choose_direction(blocked((0, 71)), 10.0, 0.0, -1.0, PREVIOUS) < 0.0


def test_a_narrow_valley_is_taken_in_its_middle():
    walls = blocked((0, 29), (40, 71))
    assert choose_direction(walls, 2.0, 0.0, -1.0, PREVIOUS) == pytest.approx(34.5)


def test_a_wide_valley_is_entered_by_half_of_what_is_wide():
    """Free from 20 to 60: candidates 28 and 52 (eq. 16), and the target between."""
    walls = blocked((0, 19), (61, 71))
    assert choose_direction(walls, 5.0, 5.0, -1.0, PREVIOUS) == 28.0
    assert choose_direction(walls, 66.0, 66.0, -1.0, PREVIOUS) == 52.0
    assert choose_direction(walls, 40.0, 5.0, -1.0, PREVIOUS) == 40.0


def test_valleys_across_the_zero_are_one():
    walls = blocked((10, 60))
    assert choose_direction(walls, 0.0, 0.0, -1.0, PREVIOUS) == 0.0
    assert choose_direction(walls, 35.0, 9.0, -1.0, PREVIOUS) == pytest.approx(1.0)


def test_it_keeps_to_the_side_that_it_took():
    """The target lies behind a wall, a little nearer to its right end."""
    walls = blocked((30, 41))
    right = choose_direction(walls, 35.4, 35.0, -1.0, PREVIOUS)
    assert right == pytest.approx(21.0)
    assert choose_direction(walls, 35.4, 35.0, 50.0, PREVIOUS) == pytest.approx(50.0)


def test_sectors_are_of_five_degrees():
    cell = np.array([[math.cos(1.0), math.sin(1.0), 1.0]])
    density = polar_histogram(cell, 0.0, 0.0, NUMBERS)
    middle = np.mean(np.flatnonzero(density)) * 5.0
    assert middle == pytest.approx(math.degrees(1.0), abs=2.5)
