"""Tracks the sources in a stream of sound and reports them while they sound."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.array_geometry import (
    LOWEST_LIVE_HZ,
    ArrayGeometry,
    usable_band,
)
from analysis.arrays.channel_fault import ChannelFault, channel_names
from analysis.arrays.live_faults import LiveFaults
from analysis.arrays.prepared_recording import chosen_microphones
from analysis.arrays.recorded_samples import array_mismatch
from analysis.arrays.sound_stream import SoundBlock, SoundStream, StreamBrokenError
from analysis.arrays.voting.direction_votes import VotePlan
from analysis.arrays.voting.source_listener import (
    ListenerMemory,
    ListenerParameters,
    TrackedSources,
    hear_sources,
)
from systems.framework.input_error import InputError

# Kinds of faults that make bearings wrong. Only the user can correct them.
_FATAL = ("copied", "swapped", "units", "speed")

# Kinds of faults whose channels are left out.
_LEFT_OUT = ("dead", "unaligned", "slipped", "drift")

# Kinds of faults that do not make the bearings before them wrong.
_RECENT = ("dead", "slipped")

# Kinds of faults that do not make bearings uncertain.
_HARMLESS = ("clipped", "inverted", "moves")

# Time for which bearings are uncertain after a fault that cannot be mended, s. The
# channels are examined again at least twice in this time.
_DOUBT_S = 60.0

# Least number of channels that go on without a dead one.
_LEAST_LEFT = 3

# Least power that a level expresses, relative to full scale: -120 dB.
_QUIET = 1e-12

# Largest confidence while the phases do not fit the array.
_NOT_SURE = 0.5

# Largest magnitude of a valid sample; full scale is 1.
_WILD = 1e3


@dataclass
class HeardStream:
    """Summary of what was heard in a stream."""

    seconds: float = 0.0
    identities: set[int] = field(default_factory=set)
    """Identities of all sources."""
    faults: list[str] = field(default_factory=list)
    """Messages about faults, without repetitions."""
    status: str = "the stream has ended"
    failed: bool = False
    """Whether the stream ended by a fault, not by its end or by an interrupt."""

    def document(self) -> dict[str, Any]:
        """Returns the last line of the JSON output."""
        return {
            "status": self.status,
            "seconds": round(self.seconds, 6),
            "sources": len(self.identities),
            "faults": self.faults,
        }


@dataclass(frozen=True)
class HeardStep:
    """Sources and level of a step."""

    sources: TrackedSources
    level_db: float
    """Root-mean-square level of all channels since the last step, dB relative to full
    scale."""


class LiveHearing:
    """Tracks the sources in a stream with the array that hears it.

    Calls ``name_fault`` once for each fault, as soon as the fault is detected, with the
    message and the time in s. Raises ``InputError`` if the stream does not match the
    array, or if the array cannot measure bearings.
    """

    def __init__(
        self,
        stream: SoundStream,
        geometry: ArrayGeometry,
        name_fault: Callable[[str, float], None] = lambda fault, t_s: None,
    ) -> None:
        rate = stream.sample_rate_hz
        complaint = array_mismatch(geometry, stream.channels, rate)
        self.heard = HeardStream()
        self._stream, self._geometry = stream, geometry
        self._name_fault = name_fault
        self._samples = 0
        self._named: set[Hashable] = set()
        self._alive = list(range(len(geometry.microphones)))
        self._signs = np.ones((len(self._alive), 1), np.float32)
        self._doubted_until_s = -math.inf
        with ExitStack() as stack:
            stack.callback(stream.close)
            if complaint:
                raise InputError("input", f"it {complaint}")
            self._plan = self._voting(geometry)
            stack.pop_all()
        self._memory = ListenerMemory.blank(self._plan)

    def _voting(self, geometry: ArrayGeometry) -> VotePlan:
        rate, known = float(self._stream.sample_rate_hz), geometry.known
        band_hz = usable_band(geometry.band, rate, lowest_hz=LOWEST_LIVE_HZ)
        return VotePlan.of(known.shape, known.c, rate, band_hz=band_hz)

    def steps(self) -> Iterator[HeardStep]:
        """Yields the sources of each step as soon as the sound of the step has arrived.

        Raises ``StreamBrokenError`` if the stream breaks off, or if too few channels
        are left to measure bearings.
        """
        looks = LiveFaults(self._geometry, self._stream.sample_rate_hz)
        powers: list[float] = []
        try:
            for block in self._stream.blocks:
                channels = self._accepted(block, looks)
                for fault in looks.look(channels):
                    self._mend(fault, looks)
                alive = channels[self._alive]
                powers.append(float(np.mean(np.square(alive))) if alive.size else 0.0)
                steps, self._memory = hear_sources(
                    alive, self._memory, self._plan, ListenerParameters()
                )
                for step in steps:
                    self.heard.identities |= {track.identity for track in step.tracks}
                    power = max(_QUIET, float(np.mean(powers)))
                    doubted = step.unfit or step.t_s < self._doubted_until_s
                    told = replace(step, unfit=doubted)
                    yield HeardStep(told, 10.0 * math.log10(power))
                    powers.clear()
                # Lines do not wait for the comparison of the channels.
                for fault in looks.compare():
                    self._mend(fault, looks)
            for fault in looks.finish():
                self._mend(fault, looks)
        finally:
            looks.close()
            self._stream.close()

    def _accepted(self, block: SoundBlock, looks: LiveFaults) -> NDArray[np.float32]:
        """Returns the array's channels of a block, and reports faults of the block.

        A block with invalid samples counts as silence.
        """
        channels = block.samples[list(self._geometry.columns)]
        self._samples += channels.shape[1]
        self.heard.seconds = self._samples / self._stream.sample_rate_hz
        for fault in block.faults:
            self._name(fault)
        if block.gap:
            looks.begin()
            self._memory = self._memory.after_gap(self._plan, keeps_tracks=False)
        wild = ~(np.abs(channels) < _WILD)
        if wild.any():
            k, first = np.argwhere(wild)[0]
            self._name(
                f"channel {k + 1}: a sample is {channels[k, first]:g}, of a full scale "
                "of 1; such blocks count as silence; check --format and the sender",
                ("wild", int(k)),
            )
            return np.zeros_like(channels)
        return self._signs * channels

    def _mend(self, fault: ChannelFault, looks: LiveFaults) -> None:
        """Reports a fault, and continues without its effect if possible.

        An inverted channel is corrected. Channels that are dead, or not aligned in time
        with most others, are left out.
        """
        is_left_out = fault.kind in _LEFT_OUT and bool(fault.channels)
        if is_left_out and not set(fault.channels) & set(self._alive):
            return
        if fault.kind in _FATAL:
            raise self._end(fault.message)
        message = fault.message
        if fault.kind == "inverted":
            self._signs[list(fault.channels)] *= -1.0
        elif is_left_out:
            message = self._leave_out(fault)
        elif fault.kind not in _HARMLESS:
            self._doubted_until_s = self.heard.seconds + _DOUBT_S
        self._name(message, (fault.kind, *fault.channels))
        if fault.kind == "inverted" or is_left_out:
            looks.begin(self._alive)
            keeps_tracks = fault.kind in _RECENT
            self._memory = self._memory.after_gap(self._plan, keeps_tracks=keeps_tracks)

    def _leave_out(self, fault: ChannelFault) -> str:
        """Leaves out the smaller part of the channels, and returns the message."""
        out = [k for k in self._alive if k in fault.channels]
        others = [k for k in self._alive if k not in fault.channels]
        if len(out) > len(others):
            out, others = others, out
        self._alive = others
        try:
            left = chosen_microphones(self._geometry, others)
        except ValueError:
            left = None
        # Two channels that are left would silently confuse front and back.
        if left is not None and len(self._alive) >= _LEAST_LEFT:
            self._plan = self._voting(left)
        else:
            raise self._end(
                f"{fault.message}; the remaining channels give no bearings"
            ) from None
        if "left out" in fault.message:
            return fault.message
        return f"{fault.message}; {channel_names(out)} left out"

    def _end(self, fault: str) -> StreamBrokenError:
        self.heard.faults.append(fault)
        return StreamBrokenError(fault)

    def _name(self, fault: str, about: Hashable = None) -> None:
        if (about or fault) not in self._named:
            self._named.add(about or fault)
            self.heard.faults.append(fault)
            self._name_fault(fault, self.heard.seconds)


def listen_to(hearing: LiveHearing, tell: Callable[[HeardStep], None]) -> HeardStream:
    """Listens to the end of a stream, and calls ``tell`` for each step.

    The status in the result says how the stream ended. Raises ``InputError`` if the
    first samples show that the stream cannot be used.
    """
    try:
        for step in hearing.steps():
            tell(step)
    except StreamBrokenError as error:
        hearing.heard.status = f"stopped: {error}"
        hearing.heard.failed = True
    return hearing.heard


def track_document(step: HeardStep) -> list[dict[str, Any]]:
    """Makes a JSON object for each source of a step. Angles are in deg."""
    most = _NOT_SURE if step.sources.unfit else 1.0
    return [
        {
            "t_s": round(step.sources.t_s, 6),
            "source": track.identity,
            "bearing_deg": round(math.degrees(track.bearing), 3),
            "bearing_std_deg": round(math.degrees(track.bearing_std), 3),
            "elevation_deg": None
            if track.elevation is None
            else round(math.degrees(track.elevation), 3),
            "confidence": round(min(track.confidence, most), 4),
            "sounding": round(track.sounding, 4),
        }
        for track in step.sources.tracks
    ]
