"""Saves the sound of a run in Drake's simulator."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from diagrams.building.builder import SoundFollower
from diagrams.running.audio.run_audio import LISTENING, RunAudio
from diagrams.running.stop_rules import ROUNDING_S
from systems.framework.input_error import InputError
from systems.hearing.frame_block import read_audio


class DiagramAudio:
    """Reads the sound at the microphones and loudspeakers of a diagram at every tick.

    The monitor of the simulator calls this object before the updates of a tick. The
    object therefore reads the same values as the updates, and Drake computes these
    values only once. The diagram itself does not change.

    Args:
        follower: The diagram.
        audio: Open files for the sound.

    Raises:
        InputError: A robot that listens has no block with an input port ``audio``.
    """

    def __init__(self, follower: SoundFollower, audio: RunAudio) -> None:
        self._audio, self._tick_s = audio, follower.scenario.tick_s
        self._tick = -1
        self._emitters = {}
        for name in audio.loudspeakers:
            parts = follower.sources.get(name) or follower.robots[name]
            emitter = parts.blocks["emitter"]
            self._emitters[name] = emitter, emitter.GetOutputPort("emission")
        self._ears = {
            name: _Ears(name, ticks, follower.robots[name].blocks)
            for name, ticks in audio.frame_ticks.items()
        }

    def __call__(self, context: Any) -> None:
        """Saves the sound; the simulator calls this method after every step.

        Steps may be shorter than ticks; this method ignores the instants between ticks.

        Raises:
            InputError: A port carries something other than a frame of the robot's
                microphones.
            OSError: The disk is full, or fails.
        """
        time = context.get_time()
        tick = round(time / self._tick_s)
        if tick == self._tick or abs(time - tick * self._tick_s) > ROUNDING_S:
            return
        self._tick = tick
        for name, ears in self._ears.items():
            if tick % ears.frame_ticks == 0 and tick:
                self._audio.hear(name, tick, ears.frame(context))
        for name, (emitter, port) in self._emitters.items():
            emission = port.Eval(emitter.GetMyContextFromRoot(context))
            self._audio.play(name, tick, emission)


class _Ears:
    """Reads the audio frames of one robot."""

    def __init__(self, name: str, frame_ticks: int, blocks: Mapping[str, Any]) -> None:
        self.frame_ticks = frame_ticks
        readers = [b for b in blocks.values() if b.HasInputPort("audio")]
        if not readers:
            raise InputError(
                "save_audio",
                f"no block of {name} has an input port 'audio' for frames; leave "
                "--save-audio out",
            )
        self._reader, self._port = readers[0], readers[0].GetInputPort("audio")
        having = [b for b in blocks.values() if b.HasOutputPort(LISTENING)]
        self._asking = [(block, block.GetOutputPort(LISTENING)) for block in having]

    def frame(self, context: Any) -> Any:
        """The frame that ends now; None while the robot does not listen."""
        for block, port in self._asking:
            if port.Eval(block.GetMyContextFromRoot(context))[0] < 0.5:
                return None
        own = self._reader.GetMyContextFromRoot(context)
        return read_audio(own, self._port, "save_audio")
