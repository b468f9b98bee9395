"""The dynamic window: contacts along arcs, and what it admits, by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from systems.laws.baselines.dynamic_window_controller import (
    WindowNumbers,
    choose_in_window,
    time_to_contact,
)

HALF = 0.2, 0.4
NUMBERS = WindowNumbers((2.0, 0.2, 0.2), 4.0, 2.0, HALF, 0.0)
START = 0.0, 0.0, 0.0
NOTHING = np.empty((0, 3))


def places(*points):
    return np.array([(x, y, 1.0) for x, y in points])


@pytest.mark.parametrize("y", [0.0, 0.39])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_straight_until_the_front_or_the_back_is_there(y, sign):
    """(2 - 0.2) m at 0.5 m/s are 3.6 s."""
    spot = places((2.0 * sign, y))
    assert time_to_contact(spot, (0.5 * sign, 0.0), HALF) == pytest.approx(3.6)
    assert time_to_contact(spot, (-0.5 * sign, 0.0), HALF) == np.inf
    assert time_to_contact(spot, (0.0, 0.0), HALF) == np.inf


def test_beside_and_behind_there_is_no_contact():
    beside = places((2.0, 0.41), (-0.5, 0.0), (1.0, -3.0))
    assert time_to_contact(beside, (0.5, 0.0), HALF) == np.inf


def test_what_is_covered_already_does_not_count():
    for turn in (0.0, 0.5):
        assert time_to_contact(places((0.1, 0.3)), (0.5, turn), HALF) == np.inf


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_turning_in_place_sweeps_a_corner(sign):
    """A place at 0.43 m is within the front edge, 0.2 m, from acos(0.2/0.43) on."""
    far, bearing = 0.43, math.radians(20.0)
    spot = places((far * math.cos(bearing), sign * far * math.sin(bearing)))
    # Turning away from it, it turns the other way in the body's axes.
    found = time_to_contact(spot, (0.0, -sign), HALF)
    assert found == pytest.approx(math.acos(0.2 / far) - bearing)


def test_along_a_circle():
    """A post on the circle of radius 1 about (0, 1), a quarter round.

    The front edge is 0.2 m ahead of the axle: asin(0.2) before the quarter.
    """
    found = time_to_contact(places((1.0, 1.0)), (0.5, 0.5), HALF)
    assert found == pytest.approx((math.pi / 2.0 - math.asin(0.2)) / 0.5)


@pytest.mark.parametrize("seed", range(30))
def test_contacts_are_those_of_small_steps(seed):
    """By moving the rectangle along the arc, a millisecond at a time."""
    random = np.random.default_rng(seed)
    v, w = random.uniform(-0.6, 0.6), random.uniform(-2.0, 2.0)
    spots = random.uniform(-1.5, 1.5, (5, 2))
    times = np.arange(1.0, 4001.0) * 1e-3
    theta = w * times
    x, y = v / w * np.sin(theta), v / w * (1.0 - np.cos(theta))
    first = np.inf
    for px, py in spots:
        if abs(px) <= HALF[0] and abs(py) <= HALF[1]:
            continue
        dx, dy = px - x, py - y
        ahead = np.abs(np.cos(theta) * dx + np.sin(theta) * dy) <= HALF[0]
        within = ahead & (np.abs(np.cos(theta) * dy - np.sin(theta) * dx) <= HALF[1])
        if within.any():
            first = min(first, times[np.argmax(within)])
    found = time_to_contact(spots, (v, w), HALF)
    if first < np.inf:
        assert found == pytest.approx(first, abs=1.1e-3)
    else:
        assert found > 3.99


def test_it_goes_where_it_is_wanted_when_nothing_is_there():
    """As fast as the window lets it, up to the wanted speed, towards the target."""
    motion = choose_in_window(NOTHING, START, (0.3, 0.0), 0.6, 0.0, NUMBERS)
    assert motion == pytest.approx((0.4, 0.0))
    motion = choose_in_window(NOTHING, START, (0.3, 0.0), 0.35, 0.0, NUMBERS)
    assert motion == pytest.approx((0.35, 0.0), abs=0.02)
    assert choose_in_window(NOTHING, START, (0.3, 0.0), 0.6, 1.5, NUMBERS)[1] > 0.3


@pytest.mark.parametrize("gap", [0.04, 0.08, 0.15])
def test_it_can_always_stop_in_time(gap):
    """v <= sqrt(2 dist a) (eq. 14): before a wall the size of the room."""
    wall = places(*((0.2 + gap, 0.05 * k) for k in range(-60, 61)))
    v = choose_in_window(wall, START, (0.3, 0.0), 0.6, 0.0, NUMBERS)[0]
    assert v <= math.sqrt(2.0 * gap) + 1e-9
    slow = choose_in_window(wall, START, (0.0, 0.0), 0.6, 0.0, NUMBERS)
    assert slow[0] <= 0.1 + 1e-9


def test_what_is_nearer_than_it_keeps_off_is_not_touched():
    """A wall 0.05 m ahead, where 0.1 m are kept: v <= sqrt(2 dist a) holds for it."""
    numbers = NUMBERS._replace(clearance_m=0.1)
    wall = places(*((0.25, 0.05 * k) for k in range(-60, 61)))
    v = choose_in_window(wall, START, (0.3, 0.0), 0.6, 0.0, numbers)[0]
    assert v <= math.sqrt(2.0 * 0.05) + 1e-9


def test_it_backs_off_only_where_that_is_wanted():
    assert choose_in_window(NOTHING, START, (0.0, 0.0), 0.0, 0.0, NUMBERS)[0] >= 0.0
    back = choose_in_window(NOTHING, START, (0.0, 0.0), -0.1, 0.0, NUMBERS)
    assert back[0] == pytest.approx(-0.1, abs=0.02)
