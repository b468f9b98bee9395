"""The step and listen search: call, hold, bearing, arrival, endings."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from systems.radio.radio_channel import AIR_SIZE
from systems.radio.radio_range import radio_level
from systems.search import sound_search
from systems.search.parameters import SoundSearchParameters
from systems.search.search_ending import (
    AMBIGUOUS,
    CALLER_LOST,
    DEAF,
    FOUND,
    NOT_CALLED,
    NOT_HEARD,
    STEPS_GONE,
    UNDECIDED,
    fault_names,
)
from systems.search.sound_search import SoundSearch
from tests.systems.radio.frames import Frame, decode, encode

OWN = {"noise_s": 0.1, "listen_s": 0.2}
CALL, LOST = Frame(1, 12, 1.0), Frame(1, 12, 0.0)


@pytest.fixture(autouse=True)
def _short_steps(monkeypatch):
    monkeypatch.setattr(sound_search, "COMPUTE_S", 0.3)
    monkeypatch.setattr(sound_search, "MOVE_S", 0.5)


class Run:
    """A search that hears what it is told, tick by tick."""

    def __init__(self, **own: Any) -> None:
        block = SoundSearch(parameters=SoundSearchParameters(**{**OWN, **own}))
        self.step, self.state, self.tick = block.step, np.array(block.step.state), 0
        self.frames: list[Frame] = []
        self.log: list[list[float]] = []

    def go(
        self,
        ticks,
        *,
        bearing=0.5,
        distance=0.0,
        detected=1,
        ambiguous=0,
        lost=0,
        away=3.0,
        sent=(),
    ):
        for _ in range(ticks):
            data = encode(*sent)
            air = [float(len(data)), *data]
            air += [0.0] * (AIR_SIZE - len(air))
            level = radio_level(away)
            heard = (
                bearing,
                distance,
                detected,
                distance > 0,
                ambiguous,
                lost,
                level,
                10.0,
            )
            inputs = [*([float(each)] for each in heard), air]
            numbers = self.step.numbers
            self.step.step(self.tick, self.state, inputs, (), numbers)
            outputs = [[0.0], [0.0], [0.0], [0.0] * 4, [0.0] * 37]
            assert self.step.publish is not None
            self.step.publish(self.state, outputs, numbers)
            self.log.append([outputs[0][0], outputs[1][0], outputs[2][0], *outputs[3]])
            out = outputs[4]
            self.frames += decode(out[1 : 1 + 9 * int(out[0])])
            self.tick += 1
            sent = ()
        return self

    @property
    def ended(self):
        return self.log[-1][3]

    @property
    def phase(self):
        return self.log[-1][4]


def _first_move(moves):
    begin = moves.index(1.0)
    return moves.index(0.0, begin) - begin


def called(**own):
    return Run(**own).go(10).go(1, sent=(CALL,))


def test_it_hears_the_noise_first_and_waits_for_the_call():
    run = Run().go(40)
    assert [row[2] for row in run.log] == [1.0] * 4 + [0.0] * 36
    assert run.go(2, sent=(Frame(2, 12, 1.0),)).phase == 1
    assert run.go(2, sent=(CALL,)).phase == 3


def test_a_step_listens_computes_and_moves():
    run = called().go(39)
    phases = [row[4] for row in run.log]
    assert [phases.count(phase) for phase in (3, 4, 5)] == [8, 12, 20]
    assert [row[2] for row in run.log].count(2.0) == 8


def test_it_turns_by_the_bearing_clockwise_from_its_heading():
    """178 - 136 = 42 of the paper's fig. 13: a bearing of +136 deg CCW is -136."""
    run = called().go(30, bearing=math.radians(136.0))
    assert run.log[-1][0] == pytest.approx(10.0 - 136.0)
    assert run.log[-1][1] == 1.0


def test_it_reports_direction_and_distances():
    run = called().go(30, bearing=-0.5, distance=0.9, away=1.0)
    told = {frame.function: frame.value for frame in run.frames}
    assert told[13] == pytest.approx(math.degrees(0.5), abs=0.06)
    assert told[14] == pytest.approx(0.9)
    assert told[15] == pytest.approx(1.0, abs=0.01)


def test_it_arrives_by_the_range_it_hears_if_the_radio_agrees():
    assert called().go(25, distance=0.45, away=0.6).ended == FOUND
    assert called().go(25, distance=0.45, away=2.0).ended == UNDECIDED


def test_it_arrives_by_radio_alone_as_printed():
    own = {"stop": "radio", "radio_stop_m": 0.2}
    assert called(**own).go(25, distance=0.3, away=0.25).ended == UNDECIDED
    assert called(**own).go(25, away=0.18).ended == FOUND


def test_the_last_step_is_shorter(monkeypatch):
    """0.8 m heard, 0.48 m wanted: 0.32 m at 0.14 m/s take 2.4 s, not 3."""
    monkeypatch.setattr(sound_search, "MOVE_S", 3.0)
    long = called().go(200, bearing=0.0)
    short = called().go(200, bearing=0.0, distance=0.8, away=0.9)
    moves = [_first_move([row[1] for row in run.log]) for run in (long, short)]
    assert moves[0] == pytest.approx(120, abs=1)
    assert moves[1] == pytest.approx(40 * ((0.8 - 0.93 * 0.52) / 0.14 + 0.1), abs=2)


def test_the_second_holds_until_the_first_has_reported():
    run = called(waits_for=2).go(60, away=1.0)
    assert run.phase == 2
    assert run.go(100, away=1.0).phase == 2
    assert run.go(2, away=1.0, sent=(Frame(2, 16, 1.0),)).phase == 3


def test_it_holds_for_so_long_at_most(monkeypatch):
    monkeypatch.setattr(sound_search, "HOLD_S", 1.0)
    run = called(waits_for=2).go(60, away=1.0)
    assert run.phase == 2
    assert run.go(42, away=1.0).phase != 2


@pytest.mark.parametrize(
    ("heard", "ended"),
    [
        ({"detected": 0}, NOT_HEARD),
        ({"ambiguous": 1}, AMBIGUOUS),
        ({"detected": 0, "lost": 2}, DEAF),
    ],
)
def test_after_some_tries_it_gives_up_by_name(heard, ended):
    run = called().go(45, **heard)
    assert run.ended == UNDECIDED
    assert run.go(40, **heard).ended == ended
    assert all(row[1] == 0.0 for row in run.log)
    assert any(frame == Frame(2, 16, 0.0) for frame in run.go(50).frames)


def test_one_lost_microphone_is_named_and_it_goes_on():
    run = called().go(30, lost=3)
    assert fault_names(run.log[-1][6]) == ["a microphone is lost"]
    assert run.log[-1][1] == 1.0


def test_no_call_and_a_lost_caller_end_it(monkeypatch):
    monkeypatch.setattr(sound_search, "CALL_WITHIN_S", 1.0)
    assert Run().go(60).ended == NOT_CALLED
    assert Run().go(10).go(3, sent=(LOST,)).ended == CALLER_LOST


def test_all_steps_end_it():
    assert called(most_steps=2).go(200).ended == STEPS_GONE
