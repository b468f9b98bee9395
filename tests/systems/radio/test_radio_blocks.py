"""The air, levels, and what the sink knows."""

from __future__ import annotations

import math

import numpy as np
import pytest

from systems.framework.compiling import njit
from systems.radio.codec import FRAMES_SIZE
from systems.radio.parameters import RadioParameters
from systems.radio.radio_channel import AIR_SIZE, RadioChannel
from systems.radio.radio_range import RadioRange, radio_distance, radio_level
from systems.radio.sink_monitor import SinkMonitor
from tests.systems.radio.frames import Frame, decode, encode


def port(*frames):
    """The port ``frames`` that sends these."""
    data = encode(*frames)
    return [float(len(frames)), *data, *[0.0] * (FRAMES_SIZE - 1 - len(data))]


def on_air(sent, compiled=False, **own):
    """(ticks,) bytes on the air after each tick in which robots a and b sent frames."""
    block = RadioChannel(parameters=RadioParameters(**own), robots=("a", "b"), seed=5)
    step = block.step
    work = njit(step.step, cache=True) if compiled else step.step
    state, heard = np.array(step.state), []
    for tick, (first, second) in enumerate(sent):
        inputs = np.array(port(*first)), np.array(port(*second))
        work(tick, state, inputs, (), step.numbers)
        air = np.zeros(AIR_SIZE)
        assert step.publish is not None
        step.publish(state, (air,), step.numbers)
        heard.append(air[1 : 1 + int(air[0])].tolist())
    return heard


def test_a_frame_arrives_after_the_latency_and_once():
    frame = Frame(1, 12, 1.0)
    heard = on_air([((frame,), ()), *[((), ())] * 5], latency_s=0.075)
    assert heard == [[], [], encode(frame), [], [], []]


def test_two_that_send_at_once_are_heard_one_after_the_other():
    first, second = Frame(2, 5, 10.0), Frame(3, 5, 20.0)
    heard = on_air([((first,), (second,)), ((), ())], latency_s=0.025)
    assert heard[0] == encode(first, second)


def test_losses_are_as_many_as_told():
    sent = [((Frame(1, 5, 1.0),), ())] * 6000
    lost = on_air(sent, loss=0.2)
    assert np.mean([not each for each in lost[2:]]) == pytest.approx(0.2, abs=0.02)


def test_a_lost_frame_takes_no_other_with_it():
    """Four frames per tick: 80 % of them arrive, and all four in 0.8^4 of the ticks."""
    frames = (Frame(1, 5, 1.0), Frame(1, 6, 2.0))
    heard = on_air([(frames, frames)] * 4000, loss=0.2)[2:]
    arrived = np.array([len(each) for each in heard]) / 9
    assert arrived.mean() / 4.0 == pytest.approx(0.8, abs=0.01)
    assert np.mean(arrived == 4) == pytest.approx(0.8**4, abs=0.02)


def test_compiled_the_air_carries_the_same():
    sent = [((Frame(1, 5, 1.0),), (Frame(2, 13, -20.0),))] * 300
    assert on_air(sent, loss=0.1) == on_air(sent, True, loss=0.1)


def test_level_and_distance_are_inverse():
    for d in (0.2, 1.0, 7.0):
        assert radio_distance(radio_level(d)) == pytest.approx(d)
    assert radio_level(1.0) == -42.4
    assert radio_level(10.0) == pytest.approx(-42.4 - 25.0)


def test_fading_is_drawn_every_tenth_of_a_second():
    step = RadioRange(seed=2).step
    state, levels = list(step.state), []
    for tick in range(8000):
        outputs = [[0.0]]
        step.step(
            tick, state, [[0.0, 0.0, 0.0], [3.0, 4.0, 0.0]], outputs, step.numbers
        )
        levels.append(outputs[0][0])
    fresh = np.array(levels)[::4]
    assert np.array_equal(np.repeat(fresh, 4), levels)
    assert np.mean(fresh) == pytest.approx(radio_level(5.0), abs=0.3)
    assert np.std(fresh) == pytest.approx(4.0, rel=0.06)


def test_the_sink_keeps_the_last_of_each_robot():
    step = SinkMonitor(robots={"nose": 1, "ear": 2}).step
    state = np.array(step.state)
    said = [[Frame(1, 5, 30.0)], [Frame(2, 16, 1.0), Frame(1, 12, 0.0)], [], []]
    for tick, frames in enumerate(said):
        data = encode(*frames)
        air = [float(len(data)), *data, *[0.0] * (AIR_SIZE - 1 - len(data))]
        step.step(tick, state, [air], (), step.numbers)
    assert state[:5] == pytest.approx([2.0, 12.0, 0.0, 0.05, 0.0])
    assert state[5:] == pytest.approx([1.0, 16.0, 1.0, 0.05, 1.0])


def test_what_the_channel_carries_can_be_read():
    frames = [Frame(3, 13, -12.3), Frame(3, 14, 1.25)]
    heard = on_air([(tuple(frames), ()), *[((), ())] * 4])
    got = decode([byte for data in heard for byte in data])
    assert [each.function for each in got] == [13, 14]
    assert math.isclose(got[0].value, -12.3, abs_tol=1e-9)
