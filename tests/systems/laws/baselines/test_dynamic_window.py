"""The dynamic window: contacts along arcs, and what it admits, by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from systems.laws.baselines.dynamic_window_controller import (
    WindowNumbers,
    choose_in_window,
)
from systems.planning.body_contact import time_to_contact

HALF = 0.2, 0.4
#: Rims of at most 0.7 m/s, 0.4 m apart, and a lag of 0.075 s.
NUMBERS = WindowNumbers((2.0, 0.2, 0.2), HALF, 0.0, 0.2, 0.7, 0.075)
AHEAD = 3.0, 0.0, 2.8
START = 0.0, 0.0, 0.0
NOTHING = np.empty((0, 3))
FREE = NOTHING, NOTHING


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
    """As fast as the window lets it (0.125 m/s in 0.25 s), up to the wanted speed."""
    motion = choose_in_window(
        (NOTHING, NOTHING), START, (0.3, 0.0), (0.0, 0.6), AHEAD, NUMBERS
    )
    assert motion == pytest.approx((0.425, 0.0))
    motion = choose_in_window(
        (NOTHING, NOTHING), START, (0.3, 0.0), (0.0, 0.35), AHEAD, NUMBERS
    )
    assert motion == pytest.approx((0.35, 0.0))
    left = 0.0, 3.0, 2.8
    assert (
        choose_in_window(
            (NOTHING, NOTHING), START, (0.3, 0.0), (0.0, 0.6), left, NUMBERS
        )[1]
        > 0.2
    )


def driven_to_rest(wall_m, now, lag_s=0.05, tick_s=0.025):
    """Way of a robot that obeys the choices of its window before a wall, m.

    Its speed approaches the command with the lag, one period after another.
    """
    x, v, command = 0.0, now, now
    for tick in range(400):
        if tick % 10 == 0:
            pose = (x, 0.0, 0.0)
            wall = places(*((wall_m, 0.05 * k) for k in range(-60, 61)))
            command = choose_in_window(
                (wall, NOTHING), pose, (command, 0.0), (0.0, 0.6), AHEAD, NUMBERS
            )[0]
        v += (command - v) * (1.0 - math.exp(-tick_s / lag_s))
        x += v * tick_s
    return x


@pytest.mark.parametrize(
    ("gap", "now"),
    [(0.05, 0.0), (0.2, 0.3), (0.3, 0.3), (0.45, 0.5), (0.6, 0.5), (1.0, 0.6)],
)
def test_it_stops_before_a_wall_with_its_period_and_its_lag(gap, now):
    """A dead end in view, from speeds that can stop in time: v 0.325 s + v^2/(2 a)."""
    assert now * 0.325 + now * now < gap or now == 0.0
    assert driven_to_rest(0.2 + gap, now) < gap


def test_an_arc_that_leads_back_is_not_the_longest_way():
    """Nothing is on a small circle, a post is 2 m ahead: it does not circle."""
    post = places(*((2.0, 0.05 * k) for k in range(-60, 61)))
    numbers = NUMBERS._replace(gains=(0.0, 3.0, 0.0))
    motion = choose_in_window(
        (post, NOTHING), START, (0.3, 0.0), (0.0, 0.6), AHEAD, numbers
    )
    assert abs(motion[1]) < 0.3


def test_what_is_nearer_than_it_keeps_off_is_not_touched():
    """A wall 0.05 m ahead, where 0.1 m are kept: it brakes, 0.125 m/s in a period."""
    numbers = NUMBERS._replace(clearance_m=0.1)
    wall = places(*((0.25, 0.05 * k) for k in range(-60, 61)))
    v = choose_in_window(
        (wall, NOTHING), START, (0.3, 0.0), (0.0, 0.6), AHEAD, numbers
    )[0]
    assert v == pytest.approx(0.175)


def test_the_target_needs_no_clearance_but_is_not_touched():
    """A cell 0.08 m ahead: 0.1 m are kept from an obstacle, 0 m from the target."""
    numbers = NUMBERS._replace(clearance_m=0.1)
    spot, speeds = places((0.28, 0.0)), (0.0, 0.6)
    found = [
        choose_in_window(cells, START, (0.0, 0.0), speeds, AHEAD, numbers)[0]
        for cells in ((places((0.32, 0.0)), NOTHING), (NOTHING, spot))
    ]
    assert found[0] < 0.06
    assert 0.06 < found[1] < 0.2


def test_it_backs_off_only_where_that_is_wanted():
    rests = choose_in_window(
        (NOTHING, NOTHING), START, (0.0, 0.0), (0.0, 0.0), AHEAD, NUMBERS
    )
    assert rests == (0.0, 0.0)
    back = choose_in_window(
        (NOTHING, NOTHING), START, (0.0, 0.0), (-0.1, -0.1), AHEAD, NUMBERS
    )
    assert back[0] == pytest.approx(-0.1)
