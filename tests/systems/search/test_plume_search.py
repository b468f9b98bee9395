"""The step by step search by smell: times, endings, faults, frames."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from systems.search import plume_search
from systems.search.parameters import PlumeSearchParameters
from systems.search.plume_search import PlumeSearch
from systems.search.search_ending import (
    FOUND,
    NO_NOSE,
    NO_TOUCH,
    NO_WIND,
    REFUSED,
    STEPS_GONE,
    UNDECIDED,
    fault_names,
)
from tests.systems.radio.frames import Frame, decode

OWN = {"wait_s": 0.5, "rules": "upwind_gradient"}


@pytest.fixture(autouse=True)
def _short_steps(monkeypatch):
    monkeypatch.setattr(plume_search, "SENSE_S", 0.25)
    monkeypatch.setattr(plume_search, "MOVE_S", 0.5)


class Run:
    """A search that is given readings tick by tick."""

    def __init__(self, **own: Any) -> None:
        block = PlumeSearch(parameters=PlumeSearchParameters(**{**OWN, **own}))
        self.step, self.state, self.tick = block.step, np.array(block.step.state), 0
        self.noise = np.random.default_rng(1)
        self.frames: list[Frame] = []
        self.log: list[list[float]] = []

    def go(
        self, ticks, gas=(0.6, 0.6, 0.6), airflow=(2.0, 2.0), contact=(0, 0), dead=()
    ):
        for _ in range(ticks):
            readings = [g * (1 + 1e-3 * self.noise.standard_normal()) for g in gas]
            for k in dead:
                readings[k] = 1.0
            inputs = [readings, list(airflow), [30.0], list(map(float, contact))]
            numbers = self.step.numbers
            self.step.step(self.tick, self.state, inputs, (), numbers)
            outputs = [[0.0], [0.0], [0.0], [0.0] * 4, [0.0] * 37]
            assert self.step.publish is not None
            self.step.publish(self.state, outputs, numbers)
            self.log.append([outputs[0][0], outputs[1][0], outputs[2][0], *outputs[3]])
            sent = outputs[4]
            self.frames += decode(sent[1 : 1 + 9 * int(sent[0])])
            self.tick += 1
        return self

    @property
    def ended(self):
        return self.log[-1][3]


def test_a_step_takes_wait_sense_and_move():
    """0.5, 0.25 and 0.5 s: moves begin 1.25 s apart."""
    moves = np.array(Run().go(200).log)[:, 1]
    begins = np.flatnonzero(np.diff(moves, prepend=0.0) > 0)
    assert np.diff(begins).tolist() == [50] * (len(begins) - 1)
    assert moves[:50].sum() == pytest.approx(20, abs=1)


def test_it_turns_from_the_heading_that_it_has():
    """Upwind is ahead and both sides smell alike: on at 30 deg."""
    run = Run().go(40)
    assert run.log[-1][0] == pytest.approx(30.0, abs=0.5)


@pytest.mark.parametrize(
    ("gas", "ended"), [((0.6, 0.9, 0.99), FOUND), ((0.99,) * 3, REFUSED)]
)
def test_a_touch_is_a_find_only_where_it_smells(gas, ended):
    run = Run().go(35, gas).go(2, gas, contact=(1, 0))
    assert run.ended == ended
    assert run.log[-1][1] == 0.0
    assert run.log[-1][2] == (1.0 if ended == FOUND else 0.0)


def test_without_the_gate_a_wall_is_a_find():
    """As printed (docs/errata.md): the switch cannot tell."""
    assert Run(gate=False).go(35, (0.99,) * 3).go(1, contact=(0, 1)).ended == FOUND


def test_the_result_is_sent_every_second_and_readings_every_step():
    run = Run().go(35).go(1, contact=(1, 1)).go(120)
    results = [f for f in run.frames if f.function == 12]
    assert len(results) == 3
    assert {f.value for f in results} == {1.0}
    first = {f.function: f.value for f in run.frames[:7]}
    assert set(first) == {5, 2, 6, 7, 8, 9, 10}
    assert first[6] == pytest.approx(0.6, abs=0.006)
    assert first[5] == pytest.approx(30.0)


def test_extreme_readings_do_not_count():
    """One reading of 0.01 in ten; a mean would lean by several deg."""
    run = Run(wait_s=0.0).go(5).go(1, (0.01, 0.6, 0.6)).go(4)
    assert run.log[-1][0] == pytest.approx(30.0, abs=0.5)


def test_a_dead_sensor_is_named_and_left_out():
    run = Run().go(60, (0.5, 0.5, 0.5), dead=(2,))
    assert fault_names(run.log[-1][6]) == ["gas sensor 3 is dead"]
    assert run.ended == UNDECIDED
    assert run.log[-1][0] == pytest.approx(30.0, abs=0.5)  # it leans to neither side


def test_two_dead_sensors_end_it():
    assert Run().go(60, dead=(0, 2)).ended == NO_NOSE


def test_a_switch_stuck_from_the_start_is_not_heeded():
    run = Run().go(60, contact=(1, 0))
    assert run.ended == UNDECIDED
    assert fault_names(run.log[-1][6]) == ["the left contact switch is stuck"]
    assert run.go(1, contact=(1, 1)).ended == FOUND


def test_two_stuck_switches_end_it():
    assert Run().go(2, contact=(1, 1)).ended == NO_TOUCH


def test_no_wind_ends_it():
    assert Run().go(400, airflow=(0.0, 0.0)).ended == NO_WIND


def test_all_steps_end_it():
    run = Run(most_steps=3).go(400)
    assert run.ended == STEPS_GONE
    assert run.log[-1][5] == 3.0
