"""Writes the sound of a run to files: at the microphones and at the loudspeakers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from diagrams.scenario.audible import HEARD_BYTES, PLAYED_BYTES, check_audible
from diagrams.scenario.geometry_file import geometry_text
from diagrams.scenario.participants import HasMicrophones
from diagrams.scenario.scenario import Scenario
from systems.framework.input_error import InputError
from systems.framework.signals import SAMPLE_RATE_HZ, AudioFrame, Emission
from systems.hearing.frame_block import check_rate
from systems.sound.parameters import MicArrayParameters
from systems.sound.wav_writer import (
    WavWriter,
    loudest_pa,
    pcm_of_counts,
    pcm_of_pressure,
)

#: Name of the port by which a block reports whether the robot listens. A robot without
#: this port always listens.
LISTENING = "listening"


def played_in_a_tick(emission: Emission, tick_s: float) -> NDArray[np.float32]:
    """Returns the sound that a loudspeaker emitted between two ticks (control periods).

    Args:
        emission: Emission of the loudspeaker at the second tick.
        tick_s: Control period, s.

    Returns:
        (n,) samples of the sound pressure at a distance of 1 m, Pa.
    """
    now = float(emission.knot_times[-1]) - emission.start_time
    end, count = (round(t * emission.sample_rate_hz) for t in (now, tick_s))
    return emission.samples[end - count : end]


class _Heard(NamedTuple):
    """Files of a robot that listens."""

    writer: WavWriter
    geometry: str
    """Name of the geometry file."""
    microphones: MicArrayParameters
    channels: int


class _Played(NamedTuple):
    """File of a loudspeaker."""

    writer: WavWriter
    full_scale_pa: float


class RunAudio:
    """Saves the sound of one run in files that grow during the run.

    The directory contains these files:

    - ``heard.wav``: the sound at the microphones of a robot. The file has one channel
      per microphone, and the sample rate of the analog-digital converter. The samples
      are the counts of the converter times a power of two.
    - ``array.yaml``: the positions of the microphones.
    - ``played.wav``: the sound of a loudspeaker, at 100 kHz.

    If there are several robots or loudspeakers, each file name begins with the name of
    the robot or source and a dot. The time in a file equals the time in the run. While
    a robot does not listen, its file contains silence.

    Use the class as a context manager, and pass it to ``simulate``, which fills the
    files. On exit, the class closes the files, and removes them if they are empty.

    Args:
        scenario: The scenario to run.
        directory: Directory of the files. The class creates it if necessary.

    Raises:
        InputError: The scenario has no sound that can be saved, see ``check_audible``.
        InputError: A file exists already, or cannot be written.
    """

    def __init__(self, scenario: Scenario, directory: str | Path) -> None:
        check_audible(scenario)
        self.scenario, self.directory = scenario, Path(directory)
        self.until_s = 0.0
        """Length of the files, s."""
        self._tick_s = scenario.tick_s
        self._made: list[Path] = []
        self._writers: list[WavWriter] = []
        self._heard: dict[str, _Heard] = {}
        self._played: dict[str, _Played] = {}
        with ExitStack() as stack:
            stack.callback(self.close)
            try:
                self._open()
            except OSError as error:
                raise InputError(
                    "save_audio",
                    f"{error.filename or directory} cannot be made "
                    f"({error.strerror}); name another directory",
                ) from None
            stack.pop_all()

    def _open(self) -> None:
        self.directory.mkdir(parents=True, exist_ok=True)
        robots, sounds = self.scenario.robots, self.scenario.sounds()
        for name, own in robots.items():
            if own.listens and isinstance(own, HasMicrophones):
                prefix = f"{name}." if len(robots) > 1 else ""
                channels = len(own.robot.microphones_m)
                rate = round(own.microphones.sample_rate_hz)
                recording = f"{prefix}heard.wav"
                writer = self._writer(recording, channels, rate, HEARD_BYTES)
                geometry = f"{prefix}array.yaml"
                self._heard[name] = _Heard(writer, geometry, own.microphones, channels)
                text = geometry_text(self.scenario, name, recording)
                with (self.directory / geometry).open("x", encoding="utf-8") as file:
                    self._made.append(self.directory / geometry)
                    file.write(text)
        for name, sound in sounds.items():
            prefix = f"{name}." if len(sounds) > 1 else ""
            writer = self._writer(
                f"{prefix}played.wav", 1, SAMPLE_RATE_HZ, PLAYED_BYTES
            )
            self._played[name] = _Played(writer, loudest_pa(sound.level_pa))

    def _writer(self, file: str, channels: int, rate: int, size: int) -> WavWriter:
        writer = WavWriter(self.directory / file, channels, rate, size)
        self._made.append(writer.path)
        self._writers.append(writer)
        return writer

    def __enter__(self) -> RunAudio:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Closes the files, and removes them if nothing was written.

        Raises:
            OSError: The disk fails.
        """
        with ExitStack() as stack:
            for writer in self._writers:
                stack.callback(writer.close)
        if self.until_s == 0.0:
            for path in self._made:
                path.unlink(missing_ok=True)

    def check_unused(self, scenario: Scenario) -> None:
        """Checks that the files are empty and belong to ``scenario``.

        Otherwise, the method raises an ``InputError``.
        """
        if scenario != self.scenario or self.until_s > 0.0:
            raise InputError(
                "audio",
                "was opened for another run; open a new one for each run, from "
                "its scenario",
            )

    @property
    def first_heard(self) -> Path:
        """The recording of the first robot that listens."""
        return next(iter(self._heard.values())).writer.path

    def save(self, tick: int, read: Callable[[str, str], Any]) -> None:
        """Appends the sound of one tick (control period) to the files.

        For each robot that listens, the method appends the audio frame that ends at the
        tick, if there is one. For each loudspeaker, it appends the sound since the last
        tick. Both engines call this method before any block changes its state at the
        tick. At tick 0, the method saves nothing, because the sound up to this tick
        precedes the run.

        Args:
            tick: Number of the present tick.
            read: Function that returns the present value of an output port, or None if
                there is no such port. Its arguments are the name of a robot or source,
                and the name of the port.

        Raises:
            InputError: A robot that listens has no block with an output port ``audio``.
            InputError: An audio frame does not fit the robot's microphones.
            OSError: The disk is full, or fails.
        """
        if tick == 0:
            return
        for name, heard in self._heard.items():
            if tick % round(heard.microphones.frame_s / self._tick_s) == 0:
                listening = read(name, LISTENING)
                asked = listening is None or listening[0] > 0.5
                frame = read(name, "audio") if asked else None
                if asked and not isinstance(frame, AudioFrame):
                    raise InputError(
                        "save_audio",
                        f"no block of {name} publishes frames on a port 'audio'; leave "
                        "--save-audio out",
                    )
                self.hear(name, tick, frame)
        for name in self._played:
            self.play(name, tick, read(name, "emission"))

    def hear(self, robot: str, tick: int, frame: AudioFrame | None) -> None:
        """Appends a robot's audio frame, which ends at a tick (control period).

        Args:
            robot: Name of the robot.
            tick: Number of the last tick of the frame, above 0.
            frame: Audio frame of the robot's microphones, or None if the robot does not
                listen.

        Raises:
            InputError: The frame does not fit the robot's microphones.
            OSError: The disk is full, or fails.
        """
        writer, _, microphones, channels = self._heard[robot]
        shape = channels, microphones.frame_samples
        if frame is None:
            writer.write(np.zeros(shape, dtype=np.int16))
            return
        check_rate(frame, microphones.sample_rate_hz, "save_audio")
        if frame.counts.shape != shape or frame.full_scale != microphones.full_scale:
            raise InputError(
                "save_audio",
                f"a frame of {frame.counts.shape} and full scale {frame.full_scale} is "
                f"none of {robot}'s microphones, {shape} and {microphones.full_scale}",
            )
        writer.write(pcm_of_counts(frame.counts, frame.full_scale))

    def play(self, name: str, tick: int, emission: Emission) -> None:
        """Appends the sound that a loudspeaker has played in the last control period.

        Args:
            name: Name of the source, or of the robot that carries the loudspeaker.
            tick: Number of the present tick (control period), above 0.
            emission: Emission of the loudspeaker at this tick.

        Raises:
            OSError: The disk is full, or fails.
        """
        writer, full_scale_pa = self._played[name]
        pressure = played_in_a_tick(emission, self._tick_s)
        writer.write(pcm_of_pressure(pressure, full_scale_pa)[None])
        self.until_s = tick * self._tick_s

    def facts(self) -> Mapping[str, Any]:
        """Returns facts about each file as plain values; names have no directory."""
        heard = {
            name: {
                "file": own.writer.path.name,
                "geometry": own.geometry,
                "channels": own.channels,
                "sample_rate_hz": round(own.microphones.sample_rate_hz),
                "full_scale_counts": own.microphones.full_scale,
            }
            for name, own in self._heard.items()
        }
        played = {
            name: {
                "file": own.writer.path.name,
                "sample_rate_hz": SAMPLE_RATE_HZ,
                "full_scale_pa": own.full_scale_pa,
            }
            for name, own in self._played.items()
        }
        return {"until_s": self.until_s, "heard": heard, "played": played}
