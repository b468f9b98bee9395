"""Rules of the search: the paper's examples, and ours by their own formula."""

from __future__ import annotations

import math

import pytest

from systems.search.search_ending import NO_WIND, UNDECIDED
from systems.search.song_rules import song2011_turn
from systems.search.upwind_gradient import (
    RULE_MEMORY,
    upwind_angle,
    upwind_gradient_turn,
)

IN_PLUME = [1.0, 0.0, 0.0, 0.0]


def song(gas, airflow, memory=None):
    memory = [*IN_PLUME] if memory is None else memory
    turn, phase, _ = song2011_turn(gas, airflow, memory)
    return turn, phase


@pytest.mark.parametrize(
    ("point", "gas", "airflow", "expected"),
    [
        ("A: F2 above, F1 below", (0.9, 0.9, 0.9), (0.5, 1.5), (45.0, 2)),
        ("B: both below, R1 below R3 and 0.75", (0.6, 0.8, 0.7), (0.5, 0.6), (60.0, 3)),
        ("G: both above, R1 below R3", (0.6, 0.7, 0.7), (1.5, 1.6), (30.0, 4)),
    ],
)
def test_the_papers_typical_run(point, gas, airflow, expected):
    """Song 2011, 4.2; at G it prints R2 for R3."""
    assert song(gas, airflow) == expected


def test_phases_turn_to_the_other_side_alike():
    assert song((0.9, 0.9, 0.9), (1.5, 0.5)) == (-45.0, 2)
    assert song((0.7, 0.8, 0.6), (0.5, 0.6)) == (-60.0, 3)
    assert song((0.7, 0.7, 0.6), (1.5, 1.6)) == (-30.0, 4)


def test_the_rear_sensor_turns_it_back():
    assert song((0.9, 0.8, 0.95), (0.5, 0.5)) == (180.0, 3)
    assert song((0.95, 0.91, 0.95), (0.5, 0.5)) == (0.0, 3)


def test_out_of_the_plume_it_goes_to_the_strongest_sensor_until_it_is_in():
    memory = [0.0] * RULE_MEMORY
    assert song((0.96, 0.99, 0.98), (1.5, 0.5), memory) == (60.0, 1)
    assert song((0.98, 0.99, 0.96), (1.5, 0.5), memory) == (-60.0, 1)
    assert song((0.98, 0.96, 0.97), (1.5, 0.5), memory) == (180.0, 1)
    assert song((0.94, 0.93, 0.94), (1.5, 0.5), memory) == (-45.0, 2)
    assert song((0.96, 0.99, 0.98), (1.5, 0.5), memory) == (-45.0, 2)


@pytest.mark.parametrize("psi_deg", range(-35, 36, 5))
def test_two_cosine_sensors_tell_upwind_exactly(psi_deg):
    """psi: where the wind comes from, counter-clockwise."""
    psi = math.radians(psi_deg)
    left, right = math.cos(psi - math.pi / 4), math.cos(psi + math.pi / 4)
    assert upwind_angle((left, right)) == pytest.approx(-psi_deg, abs=1e-9)


def ours(gas, airflow=(2.0, 2.0), memory=None):
    memory = [0.0] * RULE_MEMORY if memory is None else memory
    return upwind_gradient_turn(gas, airflow, memory)


def test_it_leans_by_the_logarithm_of_the_ratios():
    """R1, right front, smells more: clockwise."""
    turn, phase, ended = ours((0.5, 0.6, 0.6))
    assert turn == pytest.approx(20.0 * math.log(0.6 / 0.5))
    assert (phase, ended) == (1, UNDECIDED)
    assert ours((0.01, 0.6, 0.9))[0] == pytest.approx(45.0)


def test_lost_it_casts_to_both_sides_a_step_farther_each_time():
    memory = [0.0] * RULE_MEMORY
    ours((0.5, 0.5, 0.6), memory=memory)
    turns = [ours((0.9, 0.9, 0.9), memory=memory)[0] for _ in range(6)]
    assert turns == [110.0, -110.0, -110.0, 110.0, 110.0, 110.0]
    assert ours((0.7, 0.7, 0.7), memory=memory)[1] == 1
    assert ours((0.9, 0.9, 0.9), memory=memory)[1] == 2


def test_without_wind_it_turns_round_and_then_gives_up():
    memory = [0.0] * RULE_MEMORY
    found = [ours((0.5, 0.5, 0.5), (0.0, 0.01), memory)[::2] for _ in range(3)]
    assert found == [(180.0, UNDECIDED), (180.0, UNDECIDED), (180.0, NO_WIND)]
