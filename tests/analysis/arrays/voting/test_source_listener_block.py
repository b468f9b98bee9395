"""The block hears what the pure function hears, whatever the frames."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pydrake.common.value import Value
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem

from analysis.arrays.voting.direction_votes import VotePlan
from analysis.arrays.voting.source_listener import (
    ListenerMemory,
    ListenerParameters,
    hear_sources,
)
from analysis.arrays.voting.source_listener_block import SourceListener
from systems.base.robot import RobotParameters, microphones_B
from systems.framework.input_error import InputError
from systems.framework.signals import AudioFrame
from systems.sound.acoustics import SOUND_SPEED_M_S
from systems.sound.array_shape import ArrayShape
from systems.sound.parameters import MicArrayParameters

MICROPHONES = MicArrayParameters(sample_rate_hz=16_000.0)
SECONDS = 2.0


def noise_from(bearing_deg: float) -> np.ndarray:
    """(3, k) counts of noise from far away, that pauses for a part of each second."""
    rng = np.random.default_rng(4)
    rate, count = MICROPHONES.sample_rate_hz, round(SECONDS * 16_000)
    spectrum = np.fft.rfft(rng.standard_normal(count))
    f = np.fft.rfftfreq(count, 1.0 / rate)
    spectrum[(f < 200.0) | (f > 7_000.0)] = 0.0
    turn = np.radians(bearing_deg)
    ahead = np.array([np.cos(turn), np.sin(turn)])
    late = -(microphones_B(RobotParameters()) @ ahead) / SOUND_SPEED_M_S
    waves = np.fft.irfft(spectrum * np.exp(-2j * np.pi * f * late[:, None]), count)
    waves *= (np.arange(count) % 8_000) > 2_000
    return np.rint(4_000.0 * waves + rng.standard_normal(waves.shape)).astype(np.int16)


class Frames(LeafSystem):
    """Gives the frame that ends now."""

    def __init__(self, counts: np.ndarray, rate: float) -> None:
        super().__init__()
        self._counts, self._rate = counts, rate
        self.DeclareAbstractOutputPort(
            name="audio", alloc=lambda: Value(object()), calc=self._give
        )

    def _give(self, context, output):
        end, size = round(context.get_time() * 16_000), 400
        frame = self._counts[:, max(0, end - size) : end]
        output.set_value(AudioFrame(frame, 2**15, self._rate, context.get_time()))


def listening(counts: np.ndarray, rate: float = 16_000.0):
    builder = DiagramBuilder()
    frames = builder.AddSystem(Frames(counts, rate))
    block = builder.AddSystem(SourceListener(microphones=MICROPHONES))
    builder.Connect(frames.GetOutputPort("audio"), block.GetInputPort("audio"))
    simulator = Simulator(builder.Build())
    return simulator, block


def test_frames_through_the_block_give_the_tracks_of_the_pure_function():
    counts = noise_from(35.0)
    shape = ArrayShape.of(microphones_B(RobotParameters()))
    plan = VotePlan.of(shape, SOUND_SPEED_M_S, 16_000.0)
    steps, _ = hear_sources(
        counts, ListenerMemory.blank(plan), plan, ListenerParameters()
    )
    simulator, block = listening(counts)
    context = block.GetMyContextFromRoot(simulator.get_context())
    for step in steps:
        simulator.AdvanceTo(step.t_s + 0.001)
        told = block.GetOutputPort("sources").Eval(context)
        assert told.t_s == pytest.approx(step.t_s)
        assert [t.identity for t in told.tracks] == [t.identity for t in step.tracks]
        for ours, theirs in zip(told.tracks, step.tracks, strict=True):
            assert ours.bearing == pytest.approx(theirs.bearing, abs=1e-6)
    (track,) = steps[-1].tracks
    assert np.degrees(track.bearing) == pytest.approx(35.0, abs=2.0)


def test_frames_of_another_rate_are_refused():
    simulator, _ = listening(noise_from(0.0), rate=48_000.0)
    with pytest.raises(InputError, match="48000 Hz; record at 16000 Hz"):
        simulator.AdvanceTo(0.1)


def test_a_rate_that_is_not_finite_is_refused():
    simulator, _ = listening(noise_from(0.0), rate=math.nan)
    message = r"SourceListener: audio\.sample_rate_hz is nan at 0 s, "
    with pytest.raises(ValueError, match=message):
        simulator.AdvanceTo(0.1)
