"""Finds faults of the channels of a stream while it arrives."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.array_geometry import ArrayGeometry
from analysis.arrays.channel_changes import (
    ChannelDelays,
    dying_channel,
    slipping_channels,
    stretch_delays,
)
from analysis.arrays.channel_fault import ChannelFault
from analysis.arrays.channel_faults import find_channel_faults
from analysis.arrays.channel_timing import LagSearch
from analysis.arrays.clock_drift import (
    STRETCH_S,
    MisfitMemory,
    clock_drift,
    common_lags,
)

# _CLIPPED: magnitude that counts as full scale.
# _CLIPPED_SHARE: a channel is clipped if at least this share of its samples is at full
#   scale.
_CLIPPED, _CLIPPED_SHARE = 0.999, 1e-3

# _DEAD_DB: a channel is dead if it is this far below the second loudest channel, dB.
# _LEAST_DB: least level of the second loudest channel for this test, dB. At lower
#   levels, the channels contain only the last bits of a converter.
_DEAD_DB, _LEAST_DB = 40.0, -75.0

# A look examines several stretches together, in a separate thread. All numbers except
# _FIRST_LOOKS are numbers of stretches:
# - _TOGETHER: stretches in a look.
# - _TOLD: stretches from the start of a look to the report of its faults.
# - _NEXT: stretches from one of the first looks to the next look.
# - _FIRST_LOOKS: number of the first looks.
# - _LATER: stretches from a later look to the next look.
_TOGETHER, _TOLD, _NEXT, _FIRST_LOOKS, _LATER = 6, 4, 6, 3, 60

# Number of stretches in which a channel that changes is searched.
_CHANGES = 40

# Largest number of stretches whose delays are used. If there are twice as many, every
# second stretch is dropped.
_MOST_LAGS = 240


@dataclass
class LiveFaults:
    """Examines each half second of a stream, and occasionally the last three seconds.

    The examination of three seconds takes a quarter of a second, or more with many
    channels. It therefore runs in a separate thread. Its faults are reported two
    seconds of sound after its start, or later if the examination takes longer. At the
    end of the stream, the remaining faults are reported at once.
    """

    geometry: ArrayGeometry
    sample_rate_hz: int

    def __post_init__(self) -> None:
        """Starts the thread."""
        self._known = self.geometry.known
        self._size = round(STRETCH_S * self.sample_rate_hz)
        self._worker = ThreadPoolExecutor(1)
        self._count = self._looks = 0
        self.begin(range(len(self.geometry.microphones)))

    def begin(self, alive: Sequence[int] | None = None) -> None:
        """Restarts the examination, for example after a gap.

        Without ``alive``, the same channels are used as before.
        """
        if alive is not None:
            self._alive = list(alive)
        self._held: list[NDArray[np.float32]] = []
        self._fresh: list[tuple[int, NDArray[np.float32]]] = []
        self._stretches: list[NDArray[np.float32]] = []
        self._lags: list[tuple[float, NDArray[np.float64]]] = []
        self._delays: list[tuple[float, NDArray[np.float64], NDArray[np.float64]]] = []
        self._search = (
            LagSearch.of(
                self._known,
                float(self.sample_rate_hz),
                self.geometry.band,
                self._alive,
            )
            if len(self._alive) > 2
            else None
        )
        self._misfits = MisfitMemory()
        self._pending: Future[list[ChannelFault]] | None = None
        self._next, self._due = self._count + _TOGETHER, 0

    def close(self) -> None:
        """Ends the thread."""
        self._worker.shutdown(cancel_futures=True)

    def look(self, channels: NDArray[np.float32]) -> Iterator[ChannelFault]:
        """Examines the levels of the next (n, k) samples of the array's channels.

        Channel numbers of faults begin with 0. A lasting fault is reported repeatedly.
        """
        self._held.append(channels)
        while sum(part.shape[1] for part in self._held) >= self._size:
            joined = np.concatenate(self._held, axis=1)
            self._held = [joined[:, self._size :]]
            stretch = joined[:, : self._size]
            self._count += 1
            self._fresh.append((self._count, stretch))
            yield from _clipped(stretch)
            yield from _dead(stretch)

    def compare(self) -> Iterator[ChannelFault]:
        """Compares the channels of the stretches that ``look`` has completed.

        This takes longer than ``look``. A lasting fault is reported repeatedly.
        """
        while self._fresh:
            yield from self._compare(*self._fresh.pop(0))

    def finish(self) -> Iterator[ChannelFault]:
        """Reports the remaining faults at the end of the stream."""
        if not self._looks and self._stretches and self._hears():
            self._pending = self._begin_look()
        if self._pending is not None:
            yield from self._pending.result()

    def _compare(
        self, number: int, stretch: NDArray[np.float32]
    ) -> Iterator[ChannelFault]:
        t_s = (number - 0.5) * STRETCH_S
        self._stretches = [*self._stretches, stretch][-_TOGETHER:]
        yield from self._change(t_s, stretch)
        yield from self._drift(t_s, stretch, judged=number % 4 == 0)
        if self._pending is not None:
            if number < self._due or not self._is_done(self._pending):
                return
            pending, self._pending = self._pending, None
            yield from pending.result()
        if number < self._next or len(self._stretches) < _TOGETHER:
            return
        if not self._hears():
            return
        self._next = number + (_NEXT if self._looks < _FIRST_LOOKS else _LATER)
        self._due = number + _TOLD
        self._pending = self._begin_look()

    def _hears(self) -> bool:
        """Returns whether the stretches contain sound. Silence shows no faults."""
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
            omitted=[k for k in range(self._known.shape.count) if k not in self._alive],
        )

    def _is_done(self, pending: Future[list[ChannelFault]]) -> bool:
        """Returns whether an examination is done, at the latest 2 s after its start.

        Live sound would arrive no faster.
        """
        spare = self._begun + _TOLD * STRETCH_S - time.monotonic()
        return bool(wait([pending], max(0.0, spare)).done)

    def _change(
        self, t_s: float, stretch: NDArray[np.float32]
    ) -> Iterator[ChannelFault]:
        """Finds channels that lose samples, or the sound that the others have."""
        if self._search is None:
            return
        found = stretch_delays(stretch[self._alive], self._search)
        self._delays = [*self._delays, (t_s, *found)][-_CHANGES:]
        t, lags, levels = (np.array(part) for part in zip(*self._delays, strict=True))
        delays = ChannelDelays(t, lags, levels)
        fault = dying_channel(delays, self._search)
        fault = fault or slipping_channels(delays, self._search)
        if fault is not None:
            yield fault

    def _drift(
        self, t_s: float, stretch: NDArray[np.float32], *, judged: bool
    ) -> Iterator[ChannelFault]:
        lags = common_lags(stretch[self._alive], self.sample_rate_hz)
        self._lags.append((t_s, lags))
        if len(self._lags) >= 2 * _MOST_LAGS:
            self._lags = self._lags[::2]
        # On a body, the delays of a source that moves fit no wave front in free air.
        if not judged or self._known.shape.body is not None:
            return
        chosen = self._lags[:: -(-len(self._lags) // _MOST_LAGS)]
        times = np.array([t for t, _ in chosen])
        lags = np.array([lag for _, lag in chosen])
        places = self._known.shape.p_AM
        fault = clock_drift(
            times, lags, places, self._known.c, self._alive, self._misfits
        )
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
    """Returns the (n,) levels of the channels, dB."""
    return 10.0 * np.log10(np.maximum(np.var(stretch, axis=1), 1e-30))


def _heard_db(stretch: NDArray[np.float32]) -> float:
    """Returns the second highest level of three or more channels, dB.

    The highest level is not used, because the source may be at one microphone. Of two
    channels, the second may be dead, and the result is the higher level.
    """
    return float(np.sort(_levels_db(stretch))[-min(2, len(stretch) - 1)])
