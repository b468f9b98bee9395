"""Describes streams of live sound, and checks the rate at which samples arrive."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from systems.framework.input_error import InputError

#: Length of a block, s. It is short compared with a step of the listener.
BLOCK_S = 0.02

#: Time without samples after which a stream counts as stopped, s.
SILENT_AFTER_S = 1.0
STOPPED = (
    f"no sound has come for {SILENT_AFTER_S:g} s; tracks of sources restart when it "
    "continues, and times count the sound only"
)

# The pace is the ratio between the rate at which samples arrive and the stated rate.
# - _PACE_S: duration of a measurement of the pace, s.
# - _PACE_OFF: largest permitted deviation of the pace from 1.
# - _PACE_MOST: a larger pace is not that of a live sender.
# - _WAITING: least share of time spent waiting if the sender determines the pace.
_PACE_S, _PACE_OFF, _PACE_MOST, _WAITING = 10.0, 0.03, 4.0, 0.2


class StreamBrokenError(Exception):
    """A stream ended before its regular end. The message says why."""


@dataclass(frozen=True)
class SoundBlock:
    """The next samples of all channels."""

    samples: NDArray[np.float32]
    """(channels, k) samples; full scale is 1. k may be 0."""
    faults: tuple[str, ...] = ()
    """Messages about faults before these samples."""
    gap: bool = False
    """Whether samples may be missing before these samples."""


@dataclass(frozen=True)
class SoundStream:
    """A stream of samples of all channels, in blocks."""

    channels: int
    sample_rate_hz: int
    blocks: Iterator[SoundBlock] = field(repr=False)
    """Blocks until the end of the stream. The iterator raises ``StreamBrokenError`` if
    the stream breaks off."""
    close: Callable[[], None] = field(default=lambda: None, repr=False)
    """Closes the source of the stream. The code that listens to the stream, or rejects
    it, calls this function."""


class Pace:
    """Checks whether samples arrive at the stated rate.

    The check is made only if this program waits for the samples. A file arrives as fast
    as it is read. ``clock`` returns the time in s.
    """

    def __init__(
        self, sample_rate_hz: int, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._rate = sample_rate_hz
        self._clock = clock
        self._last: float | None = None
        self.begin()

    def begin(self) -> None:
        """Restarts the measurement, for example after a stop of the stream."""
        self._since = self._clock()
        self._samples = 0
        self._waited = 0.0

    def came(self, samples: int, waited_s: float) -> tuple[str, ...]:
        """Counts samples per channel and the time spent waiting for them.

        Returns one message if the rate is wrong, otherwise nothing.
        """
        self._samples += samples
        self._waited += waited_s
        passed = self._clock() - self._since
        if passed < _PACE_S:
            return ()
        pace = self._samples / passed / self._rate
        steady = self._waited > _WAITING * passed and pace < _PACE_MOST
        before, self._last = self._last, pace if steady else None
        self.begin()
        if not steady or before is None or abs(pace - 1.0) < _PACE_OFF:
            return ()
        if abs(pace - before) > _PACE_OFF:
            return ()
        fault = (
            f"samples come at {1e-3 * pace * self._rate:.3g} kHz, and "
            f"{1e-3 * self._rate:g} kHz are stated: samples get lost, or the rate is "
            "wrong, which makes all bearings wrong; check --rate and the recorder"
        )
        return (fault,)


def check_stated(
    channels: int, rate: int, stated_channels: int | None, stated_rate: int | None
) -> None:
    """Checks the number of channels and the rate of a file against stated values.

    Raises ``InputError`` if a stated value is neither None nor that of the file.
    """
    if stated_rate not in (None, rate):
        raise InputError(
            "--rate",
            f"is {stated_rate} Hz, but the file states {rate} Hz; leave it out",
        )
    if stated_channels not in (None, channels):
        raise InputError(
            "--channels",
            f"is {stated_channels}, but the file has {channels}; leave it out",
        )


def truncated_fault(missing: int, sample_rate_hz: int) -> str:
    """Describes that a stream ended before the end that its header states.

    ``missing`` is the number of samples per channel that are missing.
    """
    return (
        f"the file is truncated: it ends {missing / sample_rate_hz:.3g} s before the "
        "end that its header states; record or copy it again"
    )
