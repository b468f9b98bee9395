"""Who sounds from where, told while it sounds."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.recordings.array_geometry import ArrayGeometry
from analysis.recordings.heard_sources import vote_plan
from analysis.recordings.sound_stream import SoundStream
from systems.framework.input_error import InputError
from systems.hearing.voting.source_listener import (
    ListenerMemory,
    ListenerParameters,
    TrackedSources,
    hear_sources,
)

__all__ = ["HeardStream", "LiveHearing", "listen", "track_document"]

_BAND_HZ = (200.0, 15_000.0)
_TOP_OF_RATE = 0.45

# What is said of channels: samples at full scale of the last while, and a level so far
# below that of the others, after so long.
_CLIPPED, _CLIPPED_SHARE = 0.999, 1e-3
_DEAD_DB, _LOOK_S = 40.0, 2.0


@dataclass
class HeardStream:
    """All that a stream held."""

    seconds: float = 0.0
    identities: set[int] = field(default_factory=set)
    """Of all sources."""
    faults: list[str] = field(default_factory=list)
    """Each named once."""
    status: str = "the stream has ended"

    def document(self) -> dict[str, Any]:
        """The last line of JSON."""
        return {
            "status": self.status,
            "seconds": self.seconds,
            "sources": len(self.identities),
            "faults": self.faults,
        }


@dataclass
class LiveHearing:
    """A stream and the array that hears it."""

    stream: SoundStream
    geometry: ArrayGeometry
    heard: HeardStream = field(default_factory=HeardStream)

    def __post_init__(self) -> None:
        """Checks that the stream is of the array."""
        known, rate = self.geometry.known, self.stream.sample_rate_hz
        most = max(self.geometry.columns)
        if most >= self.stream.channels:
            raise InputError(
                "input",
                f"it has {self.stream.channels} channels, but the array needs "
                f"{most + 1}; record every microphone on a channel of its own",
            )
        band = self.geometry.band or (
            _BAND_HZ[0],
            min(_BAND_HZ[1], _TOP_OF_RATE * rate),
        )
        self._plan = vote_plan(known.shape, known.c, float(rate), band)
        self._power = np.zeros(known.shape.count)
        self._clipped = np.zeros(known.shape.count)
        self._since = 0.0

    def steps(self) -> Iterator[TrackedSources]:
        """The sources of each step, as soon as its sound has come."""
        memory = ListenerMemory.blank(self._plan)
        columns = list(self.geometry.columns)
        for block in self.stream.blocks:
            channels = block[columns]
            self.heard.seconds += channels.shape[1] / self.stream.sample_rate_hz
            self._look(channels)
            steps, memory = hear_sources(
                channels, memory, self._plan, ListenerParameters()
            )
            for step in steps:
                self.heard.identities |= {track.identity for track in step.tracks}
                yield step
        if self.stream.trouble.cut:
            self._name("the stream ended within a sample of all channels")

    def _look(self, channels: NDArray[np.float32]) -> None:
        """Names what is wrong with channels, once."""
        if not np.isfinite(channels).all():
            raise InputError(
                "input", f"at {self.heard.seconds:.2f} s: not a number; send samples"
            )
        self._power += np.sum(channels**2, axis=1)
        self._clipped += np.sum(np.abs(channels) >= _CLIPPED, axis=1)
        self._since += channels.shape[1]
        if self.stream.trouble.overruns:
            self._name("samples were lost; close other programs, or lower the rate")
        if self._since < _LOOK_S * self.stream.sample_rate_hz:
            return
        level = 10.0 * np.log10(np.maximum(self._power, 1e-30))
        for k in np.flatnonzero(level < np.median(level) - _DEAD_DB):
            self._name(f"channel {k + 1}: dead; check its microphone")
        for k in np.flatnonzero(self._clipped > _CLIPPED_SHARE * self._since):
            self._name(f"channel {k + 1}: clipped; record with less gain")
        self._power[:] = self._clipped[:] = self._since = 0.0

    def _name(self, fault: str) -> None:
        if fault not in self.heard.faults:
            self.heard.faults.append(fault)


def listen(hearing: LiveHearing, tell: Callable[[TrackedSources], None]) -> HeardStream:
    """Listens to the end of a stream, or until it is interrupted.

    Args:
        hearing: The stream and its array.
        tell: Called for each step.

    Returns:
        What was heard.
    """
    try:
        for step in hearing.steps():
            tell(step)
    except KeyboardInterrupt:
        hearing.heard.status = "interrupted"
    except OSError as error:
        hearing.heard.status = f"the stream broke off ({error})"
    return hearing.heard


def track_document(step: TrackedSources) -> list[dict[str, Any]]:
    """A line of JSON for each source of a step.

    Args:
        step: Its sources.

    Returns:
        Time in s, angles in deg.
    """
    return [
        {
            "t_s": round(step.t_s, 6),
            "source": track.identity,
            "bearing_deg": round(math.degrees(track.bearing), 3),
            "bearing_std_deg": round(math.degrees(track.bearing_std), 3),
            "elevation_deg": None
            if track.elevation is None
            else round(math.degrees(track.elevation), 3),
            "confidence": round(track.confidence, 4),
            "sounding": round(track.sounding, 4),
        }
        for track in step.tracks
    ]
