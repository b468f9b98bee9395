"""The approach along a route: rest at the follow distance, and unseen floor."""

from __future__ import annotations

import math

import numpy as np
import pytest

from systems.planning.following import FollowNumbers
from systems.planning.route_approach import (
    approach_on_route,
    route_numbers,
    route_state,
)
from systems.safety.free_space import make_free_space

CELLS = 160
NUMBERS = route_numbers(FollowNumbers(1.2, 0.175), 0.46, 0.025)


def seen_floor():
    """8 m x 8 m around the origin, all seen free."""
    space = make_free_space(CELLS, 0.05, 1, 2)
    space.free_until[:] = math.inf
    return space


def approach(state, distance, *, speed=0.0, space=None, heading=0.0):
    """The approach of P to a target straight ahead of the origin, or aside."""
    target = np.array([0.175 + distance, 0.0])
    pose = np.array([0.0, 0.0, heading])
    floor = space or seen_floor()
    inputs = target, np.array([0.0, speed]), np.ones(1), pose, floor
    return approach_on_route(0, inputs, state, NUMBERS)


def test_it_rests_within_the_tolerance_and_goes_on_when_the_target_is_gone():
    """0.1 m is move_base's xy_goal_tolerance; 1.2 1/s is the gain of the approach."""
    state = route_state(CELLS)
    for distance, wanted in (
        (1.35, 0.18),
        (1.29, 0.0),
        (1.44, 0.0),
        (0.96, 0.0),
        (1.5, 0.36),
        (1.35, 0.18),
        (1.11, 0.0),
        (0.9, -0.15),
    ):
        found = approach(state, distance).speed_m_s
        assert found == pytest.approx(wanted), distance


def test_it_does_not_rest_at_a_target_that_moves():
    state = route_state(CELLS)
    assert approach(state, 1.25, speed=0.3).speed_m_s == pytest.approx(0.06)
    assert approach(state, 1.25).speed_m_s == 0.0
    assert approach(state, 1.25, speed=0.3).speed_m_s > 0.0


def test_a_wall_between_is_not_the_follow_distance():
    """0.6 m straight ahead, but around a wall 3 m wide: it drives."""
    space = seen_floor()
    for y in np.arange(-1.475, 1.5, 0.05):
        at = math.floor(0.65 / 0.05) % CELLS, math.floor(y / 0.05) % CELLS
        space.hits[at], space.free_until[at] = 20.0, -1.0
    found = approach(route_state(CELLS), 1.2, space=space)
    assert found.speed_m_s == pytest.approx(0.62)
    assert abs(found.y) > 0.3


def test_a_detour_on_seen_floor_is_shorter_than_five_times_as_long():
    """An unseen strip 0.6 m wide before the target has a gap 1 m aside."""
    space = seen_floor()
    cells = np.arange(-80, 80)
    for i in range(16, 28):
        for j in cells[np.abs(cells * 0.05 - 1.0) > 0.3]:
            space.free_until[i % CELLS, j % CELLS] = -1.0
    state = route_state(CELLS)
    approach(state, 2.2, space=space)
    path = state.way.path[: state.way.points[0]]
    inside = path[(path[:, 0] > 0.8) & (path[:, 0] < 1.4)]
    assert (np.abs(inside[:, 1] - 1.0) < 0.35).all()
