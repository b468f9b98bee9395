"""The estimator as a block: its ports in Drake, and the same in a compiled step."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numba import njit
from pydrake.common.value import Value
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem

from phonotaxis.testing import Bench
from systems.framework.block import RunFacts
from systems.framework.input_error import InputError
from systems.framework.signals import AudioFrame
from systems.hearing.cross_power_estimator import CrossPowerEstimator
from systems.hearing.source_fix import (
    NOTHING_HEARD,
    RANGED,
    TOO_FEW_MICROPHONES,
)
from systems.sound.parameters import MicArrayParameters

RATE = 32_000.0
#: What is asked for at each tick: noise for 4, sound for 8, and again for 3.
ASKED = [0] * 3 + [1] * 4 + [2] * 8 + [0] * 4 + [2] * 3 + [0] * 3
PORTS = (
    "source_bearing",
    "source_range",
    "p_PS_B",
    "detected",
    "range_valid",
    "ambiguous",
    "alternative_bearing",
    "lost_microphone",
    "range_status",
)


def frame(tick: int, dead: int = 0) -> AudioFrame:
    """A plane wave from ahead: 14 samples earlier at the front arm, 7 later behind.

    Where noise alone is asked for there is but that of each channel.
    """
    wave = 300.0 * np.random.default_rng(1).standard_normal(800 * (len(ASKED) + 1))
    begins = [800 * tick + 20 + shift for shift in (0, 14, -7, -7)]
    counts = np.array([wave[b : b + 800] for b in begins]).astype(np.int16)
    if ASKED[tick] == 1:
        noise = 30.0 * np.random.default_rng(tick).standard_normal((4, 800))
        counts = noise.astype(np.int16)
    if dead:
        counts[dead - 1] = 0
    return AudioFrame(counts, 2048, RATE, 0.025 * tick)


class Played(LeafSystem):
    """Frames and what is asked for, tick by tick; remembers who was evaluated."""

    def __init__(self, dead: int) -> None:
        super().__init__()
        self.evaluated: list[int] = []

        def audio(context: Any, output: Any) -> None:
            tick = round(context.get_time() / 0.025)
            self.evaluated.append(tick)
            output.set_value(frame(tick, dead))

        def listening(context: Any, output: Any) -> None:
            output.SetFromVector([ASKED[round(context.get_time() / 0.025)]])

        self.DeclareAbstractOutputPort("audio", lambda: Value(object()), audio)
        self.DeclareVectorOutputPort("listening", 1, listening)


def block() -> CrossPowerEstimator:
    return CrossPowerEstimator(microphones=MicArrayParameters(sample_rate_hz=RATE))


def in_drake(dead: int = 0) -> tuple[Any, list[int]]:
    """(ticks, 10) outputs after each tick, and the ticks that were recorded."""
    builder = DiagramBuilder()
    played, estimator = Played(dead), block()
    for system in (played, estimator):
        builder.AddSystem(system)
    for name in ("audio", "listening"):
        builder.Connect(played.GetOutputPort(name), estimator.GetInputPort(name))
    simulator = Simulator(builder.Build())
    own = estimator.GetMyContextFromRoot(simulator.get_context())
    rows: list[Any] = []
    for tick in range(len(ASKED)):
        simulator.AdvanceTo(0.025 * tick)
        simulator.AdvancePendingEvents()
        now: list[Any] = [estimator.GetOutputPort(name).Eval(own) for name in PORTS]
        rows.append(np.concatenate(now))
    return np.array(rows), played.evaluated


def compiled(dead: int = 0) -> tuple[Any, list[int]]:
    """The same from the step of a compiled loop."""
    recorded: list[int] = []

    def audio(tick: int) -> AudioFrame:
        recorded.append(tick)
        return frame(tick, dead)

    step = block().step_for(facts({"audio": audio}))
    state = np.array(step.state, dtype=float)
    outputs = tuple(np.zeros(2 if name == "p_PS_B" else 1) for name in PORTS)
    compiling: Any = njit
    do, publish = compiling(step.step), compiling(step.publish)
    rows = []
    for tick, asked in enumerate(ASKED):
        do(tick, state, (np.array([float(asked)]),), outputs, step.numbers)
        publish(state, outputs, step.numbers)
        rows.append(np.concatenate(outputs))
    return np.array(rows), recorded


def facts(carried: dict[str, Any]) -> RunFacts:
    return RunFacts(
        ticks=len(ASKED),
        tick_s=0.025,
        initial_pose=(0.0, 0.0, 0.0),
        step_s=0.025,
        seed_of=lambda _: 0,
        carried=carried,
    )


def test_the_estimate_stands_from_the_tick_after_listening_until_it_begins_again():
    rows, evaluated = in_drake()
    detected = rows[:, 4]
    over, again = 15, 19
    assert not detected[:over].any()
    assert detected[over:again].all()
    assert not detected[again:].any()  # three frames are too few for another
    held = rows[over:again]
    np.testing.assert_array_equal(held, np.tile(held[0], (4, 1)))
    bearing, distance, x, y, _, ranged, ambiguous, _, lost, status = held[0]
    assert abs(math.degrees(bearing)) < 3.0
    assert (ambiguous, lost) == (0.0, 0.0)
    assert ranged == (status == RANGED)
    np.testing.assert_array_equal(rows[:, 9] != NOTHING_HEARD, detected == 1.0)
    if not ranged:
        assert (distance, math.hypot(x, y)) == pytest.approx((0.0, 1.0))
    # What is not asked for is not recorded.
    assert evaluated == [tick for tick, asked in enumerate(ASKED) if asked]


@pytest.mark.parametrize("dead", [0, 3])
def test_drake_and_a_compiled_step_hear_the_same(dead):
    (drake, evaluated), (loop, recorded) = in_drake(dead), compiled(dead)
    np.testing.assert_array_equal(drake, loop)
    assert evaluated == recorded


@pytest.mark.parametrize("dead", [1, 2, 4])
def test_a_lost_microphone_is_named_and_three_still_hear(dead):
    rows, _ = in_drake(dead)
    assert rows[15, 8] == dead
    assert rows[15, 4] == 1.0
    assert rows[15, 5] == 0.0
    assert rows[15, 9] == TOO_FEW_MICROPHONES
    assert abs(math.degrees(rows[15, 0])) < 5.0


def test_something_else_than_audio_is_refused():
    at = Bench(block(), audio=object(), listening=2.0)
    with pytest.raises(TypeError, match="connect the audio of a MicArray"):
        at.tick()


def test_a_loop_without_microphones_is_refused():
    with pytest.raises(InputError, match="engine drake"):
        block().step_for(facts({}))
