"""Sound that comes in as it is made, and what goes wrong on the way."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

#: Blocks are this long, s: short beside a step of the listener.
BLOCK_S = 0.02

#: A stream that brings nothing for so long has stopped, s.
SILENT_AFTER_S = 1.0
STOPPED = (
    f"no sound has come for {SILENT_AFTER_S:g} s; tracks of sources restart when it "
    "continues, and times count the sound only"
)

# Seconds over which the pace of samples is measured; what it may be off; beyond what it
# is no rate; and the part of the time that is spent on waiting where the pace is that
# of the sender.
_PACE_S, _PACE_OFF, _PACE_MOST, _WAITING = 10.0, 0.03, 4.0, 0.2


class StreamBrokenError(Exception):
    """A stream ended otherwise than at its end; says how."""


@dataclass(frozen=True)
class SoundBlock:
    """The next samples of all channels."""

    samples: NDArray[np.float32]
    """(channels, k), full scale 1; k may be 0."""
    faults: tuple[str, ...] = ()
    """What went wrong before them."""
    gap: bool = False
    """Whether samples may be missing before them."""


@dataclass(frozen=True)
class SoundStream:
    """Samples of all channels, block after block."""

    channels: int
    sample_rate_hz: int
    blocks: Iterator[SoundBlock] = field(repr=False)
    """They end with the stream, and raise ``StreamBrokenError`` where it breaks off."""
    close: Callable[[], None] = field(default=lambda: None, repr=False)
    """Gives back what it comes from; called by whoever hears it, or refuses to."""


class Pace:
    """Tells whether samples come at the rate that is stated.

    It is measured only while this program waits for them: a file comes as fast as it
    is read.

    Args:
        sample_rate_hz: That is stated, Hz.
        clock: Of this computer, s.
    """

    def __init__(
        self, sample_rate_hz: int, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._rate = sample_rate_hz
        self._clock = clock
        self._last: float | None = None
        self.begin()

    def begin(self) -> None:
        """Begins anew, as after a stop."""
        self._since = self._clock()
        self._samples = 0
        self._waited = 0.0

    def came(self, samples: int, waited_s: float) -> tuple[str, ...]:
        """Counts a block.

        Args:
            samples: That have come, of a channel.
            waited_s: Time that was spent on waiting for them, s.

        Returns:
            What is wrong: nothing, or one message.
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
