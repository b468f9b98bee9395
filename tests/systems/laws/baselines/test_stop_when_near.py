"""Stop when near, and what all baselines ask of following."""

from __future__ import annotations

import math

import pytest

from systems.laws.baselines.stop_when_near_controller import (
    StopNumbers,
    stop_when_near_step,
)
from systems.laws.stop_when_near import StopWhenNearParameters
from systems.planning.following import FollowNumbers, approach

FOLLOW = FollowNumbers(1.2, 0.175)
NUMBERS = StopNumbers(StopWhenNearParameters(stop_m=0.6), FOLLOW)


def twist(target, *, ranges=(3.0, 3.0), echo=(0.0, 0.0), velocity=(0.0, 0.0), valid=1):
    outputs = [[0.0, 0.0]]
    inputs = [target, velocity, [valid], [0.0, 0.0, 0.0], [*ranges], [*echo]]
    stop_when_near_step(0, [], inputs, outputs, NUMBERS)
    return outputs[0]


def test_far_off_it_cruises_and_near_by_it_goes_by_the_distance():
    assert twist([5.0, 0.0]) == pytest.approx([0.62, 0.0])
    left = 1.6 - 0.175 - 1.2
    assert twist([1.6, 0.0]) == pytest.approx([1.2 * left, 0.0])
    assert twist([1.0, 0.0]) == pytest.approx([-0.15, 0.0])


def test_it_turns_first_then_drives():
    assert twist([0.0, 5.0]) == pytest.approx([0.0, 2.0])
    speed, turn = twist([5.0, 1.0])
    bearing = math.atan2(1.0, 5.0)
    assert speed == pytest.approx(0.62 * math.cos(bearing))
    assert turn == pytest.approx(3.0 * bearing)


def test_an_echo_that_is_near_stops_it_and_nothing_else():
    assert twist([5.0, 0.0], ranges=(0.5, 3.0), echo=(1.0, 0.0))[0] == 0.0
    assert twist([5.0, 0.0], ranges=(0.5, 3.0), echo=(0.0, 0.0))[0] == 0.62
    assert twist([5.0, 0.0], ranges=(0.7, 3.0), echo=(1.0, 0.0))[0] == 0.62
    assert twist([1.0, 0.0], ranges=(0.5, 3.0), echo=(1.0, 0.0))[0] == -0.15


def test_without_a_target_it_rests():
    assert twist([9.0, 9.0], valid=0) == [0.0, 0.0]


def test_the_targets_own_speed_counts_as_far_as_it_leads_away():
    inputs = [[2.0, 0.0], [0.3, 5.0], [1.0], [0.0, 0.0, 0.0]]
    left = 2.0 - 0.175 - 1.2
    wanted, bearing = approach(inputs, FOLLOW)
    assert wanted == pytest.approx(min(1.2 * left + 0.8 * 0.3, 0.62))
    assert bearing == 0.0
