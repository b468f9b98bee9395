"""What has left the loudspeaker, when, and where."""

from __future__ import annotations

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from systems.base.source_robot import SourceRobot, SourceRobotParameters
from systems.sound.acoustics import AcousticParameters
from systems.sound.sound_emitter import SoundEmitter, emitted_samples
from systems.sound.waveforms import SoundParameters, make_waveform

FS = 100_000


def emission_at(times, *, sound=None, source=None, maximum_range_m=30.0):
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
    air = AcousticParameters(sound_speed_m_s=301.0)
    context = SoundEmitter(acoustics=air).CreateDefaultContext()
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
