"""What has left the loudspeaker, when, and where."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from phonotaxis.testing import run
from systems.base.carrier_parameters import SourceRobotParameters
from systems.base.source_robot import SourceRobot
from systems.framework.block import RunFacts
from systems.sound.mic_array import MicArray
from systems.sound.parameters import MicArrayParameters, SoundParameters
from systems.sound.sound_emitter import (
    SoundEmitter,
    emitted_samples,
)
from systems.sound.waveforms import make_waveform

pytestmark = pytest.mark.drake

FS = 100_000


def emission_at(times, *, sound=SoundParameters(), source=None, maximum_range_m=30.0):
    """Emissions of a moving source at ticks of a simulation."""
    builder = DiagramBuilder()
    robot = builder.AddSystem(SourceRobot(source=source or SourceRobotParameters()))
    emitter = builder.AddSystem(
        SoundEmitter(sound=sound, maximum_range_m=maximum_range_m)
    )
    for name in ("pose_WS", "v_WS"):
        builder.Connect(robot.GetOutputPort(name), emitter.GetInputPort(name))
    diagram = builder.Build()
    simulator = Simulator(diagram)
    found = []
    for time in times:
        simulator.AdvanceTo(time)
        context = emitter.GetMyContextFromRoot(simulator.get_context())
        found.append(emitter.GetOutputPort("emission").Eval(context))
    return found


def played(sound, first, count):
    """The same by the definition, one sample at a time."""
    waveform = make_waveform(sound)
    on, period, start = (
        round(s * FS) for s in (sound.on_s, sound.period_s, sound.start_s)
    )
    out = np.zeros(count, dtype=np.float32)
    for k in range(count):
        n = first + k - start
        if n >= 0 and n % period < on:
            out[k] = waveform[((n // period) * on + n % period) % len(waveform)]
    return out


@pytest.mark.parametrize("kind", ["chirp", "band_noise"])
@pytest.mark.parametrize("first", [-3_000, 0, 4_321, 19_000, 25_000, 60_001])
def test_samples_by_definition(kind, first):
    sound = SoundParameters(kind=kind, on_s=0.1, period_s=0.25, start_s=0.01)
    expected = played(sound, first, 6_000)
    found = emitted_samples(make_waveform(sound), sound, first, 6_000)
    if found is None:
        assert not expected.any()
    else:
        np.testing.assert_array_equal(found, expected)


def test_reaches_back_a_frame_and_the_largest_travel():
    (emission,) = emission_at([1.0], maximum_range_m=20.0)
    assert emission.start_time <= 1.0 - 0.025 - 20.0 / 340.0
    end = emission.start_time + len(emission.samples) / emission.sample_rate_hz
    assert end > 1.0
    assert emission.knot_times[0] <= emission.start_time + 1e-3
    assert emission.knot_times[-1] == pytest.approx(1.0)


def test_reaches_back_30_m_and_no_farther_unless_told():
    """At 301 m/s they take 99.7 ms, just below four ticks; and there is the frame."""
    context = SoundEmitter(sound_speed_m_s=301.0).CreateDefaultContext()
    # x, y and their rates at five past ticks, and at the one that they end on.
    assert context.get_discrete_state(0).size() == 4 * (1 + 4 + 1)


def test_path_is_that_of_the_source():
    """At ticks well after the start, on a straight line at 0.3 m/s.

    The start of 1 m/s^2 costs v^2 / 2a.
    """
    source = SourceRobotParameters(waypoints_m=((1.0, 2.0), (30.0, 2.0)))
    (emission,) = emission_at([12.0], source=source)
    t = emission.knot_times
    expected = np.stack([1.0 + 0.3 * t - 0.045, np.full_like(t, 2.0)], axis=1)
    np.testing.assert_allclose(emission.p_WS, expected, atol=1e-9)
    steady = np.tile([0.3, 0.0], (len(t), 1))
    np.testing.assert_allclose(emission.v_WS, steady, atol=1e-9)


def test_silence_before_the_start_and_between_the_bursts():
    sound = SoundParameters(start_s=0.1)
    times = (0.0, 0.05, 0.125, 0.6, 0.8, 2.0, 2.125)
    found = [emission.sounding for emission in emission_at(times, sound=sound)]
    assert found == [False, False, True, True, False, False, True]


def test_samples_stand_at_their_times():
    sound = SoundParameters()
    (emission,) = emission_at([0.4], sound=sound)
    first = round(emission.start_time * FS)
    waveform = make_waveform(sound)
    k = 30_000
    assert emission.samples[k - first] == waveform[k]


def test_emission_cannot_be_changed():
    (emission,) = emission_at([0.4])
    for array in (emission.samples, emission.p_WS, emission.v_WS):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0


def test_called_on_it_plays_from_that_tick_as_one_that_starts_then():
    """Called at 0.1 s: nothing has left it before, and then its schedule begins."""
    sound = SoundParameters(on_s=0.2, period_s=0.4)
    late = SoundParameters(on_s=0.2, period_s=0.4, start_s=0.1)
    emissions: dict[str, Any] = {}
    for name, own, called in (("called", sound, True), ("clock", late, False)):
        calls: dict[str, Any] = {"calling": lambda t: float(t > 0.09)}
        history = run(
            SoundEmitter(sound=own, called=called),
            0.275,
            pose_WS=[0.0] * 3,
            v_WS=[0.0] * 3,
            **(calls if called else {}),
        )
        assert not called or not history["emission"][3].sounding
        emissions[name] = history["emission"][-1]
    assert np.any(emissions["clock"].samples)
    assert np.array_equal(emissions["called"].samples, emissions["clock"].samples)


def heard_1_7_m_away(emitter, calling_from_s=None):
    """Counts at ticks of 25 ms of a robot that stands 1.7 m from a loudspeaker."""
    builder = DiagramBuilder()
    quiet = MicArrayParameters(snr_db_at_1m=150.0, adc_bits=16)
    source, array = (
        builder.AddSystem(emitter),
        builder.AddSystem(MicArray(parameters=quiet)),
    )
    builder.Connect(source.GetOutputPort("emission"), array.GetInputPort("emission"))
    simulator = Simulator(builder.Build())
    contexts = [
        block.GetMyMutableContextFromRoot(simulator.get_mutable_context())
        for block in (source, array)
    ]
    # The middle microphone stands 0.175 m ahead of the axle.
    source.GetInputPort("pose_WS").FixValue(contexts[0], [1.875, 0.0, 0.0])
    source.GetInputPort("v_WS").FixValue(contexts[0], [0.0] * 3)
    for name in ("pose_WB", "velocity_WB"):
        array.GetInputPort(name).FixValue(contexts[1], [0.0] * 3)
    frames = []
    for tick in range(12):
        if calling_from_s is not None:
            on = tick * 0.025 > calling_from_s - 1e-9
            source.GetInputPort("calling").FixValue(contexts[0], [float(on)])
        simulator.AdvanceTo(tick * 0.025)
        audio: Any = array.GetOutputPort("audio").Eval(contexts[1])
        simulator.AdvancePendingEvents()
        frames.append(audio.counts)
    return np.concatenate(frames, axis=1)


def test_a_call_is_heard_once_it_has_traveled_and_as_exactly_as_a_clock():
    """1.7 m take 5 ms; the second tick of 25 ms begins the call at 0.1 s."""
    sound = SoundParameters(on_s=0.05, period_s=0.1)
    late = sound.model_copy(update={"start_s": 0.1})
    called = heard_1_7_m_away(SoundEmitter(sound=sound, called=True), 0.1)
    clock = heard_1_7_m_away(SoundEmitter(sound=late))
    np.testing.assert_array_equal(called, clock)
    # The first frame ends at 0 s.
    times = (np.arange(called.shape[1]) - 2_500) / FS
    assert not called[:, times < 0.1049].any()
    assert called[1, (times > 0.1052) & (times < 0.11)].any()


def test_a_called_sound_of_a_loop_is_that_of_the_block():
    """What a compiled run hears, at every tick, from when the call was noted."""
    sound = SoundParameters(on_s=0.2, period_s=0.4)
    block = SoundEmitter(sound=sound, called=True)
    context = block.CreateDefaultContext()
    for port in ("pose_WS", "v_WS"):
        block.GetInputPort(port).FixValue(context, [0.0] * 3)
    facts = RunFacts(
        ticks=12,
        tick_s=0.025,
        initial_pose=(0.0, 0.0, 0.0),
        step_s=0.025,
        seed_of=lambda _: 0,
        carried={},
    )
    step = block.step_for(facts)
    emission = step.carries["emission"]
    simulator = Simulator(block, context)
    for tick in range(12):
        block.GetInputPort("calling").FixValue(context, [float(tick >= 5)])
        simulator.AdvanceTo(0.025 * tick)
        simulator.AdvancePendingEvents()
        called = np.array([0.0] * 6 + [float(tick >= 5)])
        step.host.function(tick, called, np.zeros(0))
        own: Any = block.GetOutputPort("emission").Eval(context)
        loop = emission(tick)
        np.testing.assert_array_equal(own.samples, loop.samples)
        assert own.start_time == loop.start_time
        assert own.sounding == loop.sounding == (tick >= 5)
