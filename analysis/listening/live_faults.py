"""What is wrong with the channels of a stream, looked at while it comes."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.recordings.array_geometry import ArrayGeometry
from analysis.recordings.channel_faults import ChannelFault, find_channel_faults
from analysis.recordings.clock_drift import STRETCH_S, clock_drift, common_lags

# Share of samples at full scale from which on a channel is clipped.
_CLIPPED, _CLIPPED_SHARE = 0.999, 1e-3

# A channel so far below the others is dead, dB, where those hear more than the last
# bits of a converter.
_DEAD_DB, _LEAST_DB = 40.0, -75.0

# Stretches that are looked at together beside the stream; how many later what they show
# is told; and how many later the next look begins, for the first looks and afterwards.
_TOGETHER, _TOLD, _NEXT, _FIRST_LOOKS, _LATER = 6, 4, 6, 3, 60

# Delays of no more than so many stretches count, every other one of twice as many.
_MOST_LAGS = 240


@dataclass
class LiveFaults:
    """Looks at every half second of a stream, and at three seconds now and then.

    The latter takes a quarter of a second, more with many channels, and is done in a
    thread of its own, beside the stream; what it has found is told two seconds of sound
    later, or when it is done, or at the end of the stream.
    """

    geometry: ArrayGeometry
    sample_rate_hz: int

    def __post_init__(self) -> None:
        """Makes the thread."""
        self._known = self.geometry.known
        self._size = round(STRETCH_S * self.sample_rate_hz)
        self._worker = ThreadPoolExecutor(1)
        self._count = self._looks = 0
        self.begin(range(len(self.geometry.microphones)))

    def begin(self, alive: Sequence[int] | None = None) -> None:
        """Begins anew, as after a gap or with fewer channels.

        Args:
            alive: Channels that count from here on; none: those of before.
        """
        if alive is not None:
            self._alive = list(alive)
        self._held: list[NDArray[np.float32]] = []
        self._stretches: list[NDArray[np.float32]] = []
        self._lags: list[tuple[float, NDArray[np.float64]]] = []
        self._pending: Future[list[ChannelFault]] | None = None
        self._next, self._due = self._count + _TOGETHER, 0

    def close(self) -> None:
        """Ends the thread."""
        self._worker.shutdown(cancel_futures=True)

    def look(self, channels: NDArray[np.float32]) -> Iterator[ChannelFault]:
        """What is seen with another block of samples; its channels count from 0.

        Args:
            channels: (n, k) of the array.

        Yields:
            Faults, the same ones again and again.
        """
        self._held.append(channels)
        while sum(part.shape[1] for part in self._held) >= self._size:
            joined = np.concatenate(self._held, axis=1)
            self._held = [joined[:, self._size :]]
            yield from self._of_stretch(joined[:, : self._size])

    def finish(self) -> Iterator[ChannelFault]:
        """What the stream showed that was not told yet.

        Yields:
            Faults.
        """
        if not self._looks and self._stretches and self._hears():
            self._pending = self._begin_look()
        if self._pending is not None:
            yield from self._pending.result()

    def _of_stretch(self, stretch: NDArray[np.float32]) -> Iterator[ChannelFault]:
        self._count += 1
        self._stretches = [*self._stretches, stretch][-_TOGETHER:]
        yield from _clipped(stretch)
        yield from _dead(stretch)
        yield from self._drift(stretch)
        if self._pending is not None:
            if self._count < self._due or not self._is_done(self._pending):
                return
            pending, self._pending = self._pending, None
            yield from pending.result()
        if self._count < self._next or len(self._stretches) < _TOGETHER:
            return
        if not self._hears():
            return
        self._next = self._count + (_NEXT if self._looks < _FIRST_LOOKS else _LATER)
        self._due = self._count + _TOLD
        self._pending = self._begin_look()

    def _hears(self) -> bool:
        """Whether there is sound in what would be looked at: silence shows nothing."""
        return max(_heard_db(stretch) for stretch in self._stretches) > _LEAST_DB

    def _begin_look(self) -> Future[list[ChannelFault]]:
        self._looks += 1
        self._begun = time.monotonic()
        return self._worker.submit(
            find_channel_faults,
            np.concatenate(self._stretches, axis=1).astype(np.float64),
            self._known,
            sample_rate_hz=float(self.sample_rate_hz),
            band_hz=self.geometry.band,
        )

    def _is_done(self, pending: Future[list[ChannelFault]]) -> bool:
        """Waits for it only as long as sound that is made now would have taken."""
        spare = self._begun + _TOLD * STRETCH_S - time.monotonic()
        return bool(wait([pending], max(0.0, spare)).done)

    def _drift(self, stretch: NDArray[np.float32]) -> Iterator[ChannelFault]:
        t_s = (self._count - 0.5) * STRETCH_S
        lags = common_lags(stretch[self._alive], self.sample_rate_hz)
        self._lags.append((t_s, lags))
        if len(self._lags) >= 2 * _MOST_LAGS:
            self._lags = self._lags[::2]
        if self._count % 4:
            return
        chosen = self._lags[:: -(-len(self._lags) // _MOST_LAGS)]
        times = np.array([t for t, _ in chosen])
        lags = np.array([lag for _, lag in chosen])
        places = self._known.shape.p_AM
        fault = clock_drift(times, lags, places, self._known.c, self._alive)
        if fault is not None:
            yield fault


def _clipped(stretch: NDArray[np.float32]) -> Iterator[ChannelFault]:
    share = np.mean(np.abs(stretch) >= _CLIPPED, axis=1)
    for k in np.flatnonzero(share > _CLIPPED_SHARE):
        message = f"channel {k + 1}: clipped; record with less gain"
        yield ChannelFault("clipped", (int(k),), message)


def _dead(stretch: NDArray[np.float32]) -> Iterator[ChannelFault]:
    others = _heard_db(stretch)
    if others < _LEAST_DB:
        return
    for k in np.flatnonzero(_levels_db(stretch) < others - _DEAD_DB):
        message = f"channel {k + 1}: dead, and left out; check its microphone"
        yield ChannelFault("dead", (int(k),), message)


def _levels_db(stretch: NDArray[np.float32]) -> NDArray[np.float64]:
    """(n,) of the channels."""
    return 10.0 * np.log10(np.maximum(np.var(stretch, axis=1), 1e-30))


def _heard_db(stretch: NDArray[np.float32]) -> float:
    """The second highest level: the source may be at one microphone."""
    return float(np.sort(_levels_db(stretch))[-2])
