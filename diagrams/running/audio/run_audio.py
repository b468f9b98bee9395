"""What robots hear and loudspeakers play in a run, on its way to files."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from diagrams.scenario.audible import HEARD_BYTES, PLAYED_BYTES, check_audible
from diagrams.scenario.geometry_file import geometry_text
from diagrams.scenario.scenario import Scenario
from systems.framework.input_error import InputError
from systems.framework.signals import SAMPLE_RATE_HZ, AudioFrame, Emission
from systems.hearing.audio_port import check_rate
from systems.sound.parameters import MicArrayParameters
from systems.sound.wav_writer import (
    WavWriter,
    loudest_pa,
    pcm_of_counts,
    pcm_of_pressure,
)

#: Port by which a block says whether it listens; without one, robots always do.
LISTENING = "listening"


def played_in_a_tick(emission: Emission, tick_s: float) -> NDArray[np.float32]:
    """What left a loudspeaker from one tick to the next.

    Args:
        emission: At the second one.
        tick_s: Between the two, s.

    Returns:
        (n,) sound pressure at 1 m, Pa.
    """
    now = float(emission.knot_times[-1]) - emission.start_time
    end, count = (round(t * emission.sample_rate_hz) for t in (now, tick_s))
    return emission.samples[end - count : end]


class _Heard(NamedTuple):
    """Of a robot that listens."""

    writer: WavWriter
    geometry: str
    """Name of its geometry file."""
    microphones: MicArrayParameters
    channels: int


class _Played(NamedTuple):
    """Of a loudspeaker."""

    writer: WavWriter
    full_scale_pa: float


class RunAudio:
    """Files of what is heard and played in one run, which grow while it goes on.

    ``heard.wav`` has a channel for each microphone, at the converter's rate and as its
    counts times a power of two; ``array.yaml`` says where the microphones are;
    ``played.wav`` is what the loudspeaker emits, at 100 kHz. Where there are several,
    the robot's or source's name and a dot stand in front. Time in the files is time in
    the run: what nobody asked the microphones for is silence.

    A context manager: it closes the files, and removes them if nothing has been
    written. ``simulate`` fills them.

    Args:
        scenario: What is to be run.
        directory: Where they go; made if need be.

    Raises:
        InputError: As ``check_audible``, or a file is there already, or cannot be
            written.
    """

    def __init__(self, scenario: Scenario, directory: str | Path) -> None:
        check_audible(scenario)
        self.scenario, self.directory = scenario, Path(directory)
        self.until_s = 0.0
        """How far the files go, s."""
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
        robots, sounds = self.scenario.all_robots, self.scenario.sounds()
        for name, own in robots.items():
            if own.listens:
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
        """Ends the files.

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
        """Refuses a run of another scenario, or a second one.

        Args:
            scenario: What is to be run.

        Raises:
            InputError: It is another one, or something was written.
        """
        if scenario != self.scenario or self.until_s > 0.0:
            raise InputError(
                "audio",
                "was opened for another run; open a new one for each run, from "
                "its scenario",
            )

    @property
    def frame_ticks(self) -> dict[str, int]:
        """Of each robot that listens, ticks from frame to frame."""
        return {
            name: round(heard.microphones.frame_s / self._tick_s)
            for name, heard in self._heard.items()
        }

    @property
    def loudspeakers(self) -> list[str]:
        """Names of what plays."""
        return [*self._played]

    @property
    def first_heard(self) -> Path:
        """The file of the first robot that listens."""
        return next(iter(self._heard.values())).writer.path

    def hear(self, robot: str, tick: int, frame: AudioFrame | None) -> None:
        """Appends the frame that ends at a tick.

        Args:
            robot: Its name.
            tick: The frame's last one; at 0 it is of the time before the run.
            frame: From the robot's microphones; None while nobody listens.

        Raises:
            InputError: The frame is none of this array.
            OSError: The disk is full, or fails.
        """
        if tick == 0:
            return
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
        """Appends what a loudspeaker has played since the last tick.

        Args:
            name: Of the source, or of the robot that carries it.
            tick: Now.
            emission: What has left it until now.

        Raises:
            OSError: The disk is full, or fails.
        """
        if tick == 0:
            return
        writer, full_scale_pa = self._played[name]
        pressure = played_in_a_tick(emission, self._tick_s)
        writer.write(pcm_of_pressure(pressure, full_scale_pa)[None])
        self.until_s = tick * self._tick_s

    def facts(self) -> Mapping[str, Any]:
        """What stands in which file, as plain values; names are without directory."""
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
