"""Plans the measurement of delays: sizes of transforms, and pairs of channels."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from systems.delays.delay_peaks import PairTables
from systems.framework.input_error import InputError
from systems.sound.array_shape import ArrayShape

# Samples per period of the highest frequency in the first search.
_GRID_DENSITY = 5.0

# The length of the transform is a multiple of this.
_TWOS = 256

# Least share of a frame that must remain after the channels are cut to their common
# section. Delays that leave less cannot be measured.
_LEAST_OVERLAP = 0.25


@dataclass(frozen=True, eq=False)
class DelayPlan:
    """Constants of the measurement of delays between channels of audio frames.

    The class computes further constants when they are read for the first time.

    Raises:
        InputError: The band does not fit the sample rate, or the frames are too short
            for the array.
    """

    shape: ArrayShape
    """The microphones, in the order of the channels."""
    c: float
    """Speed of sound, m/s."""
    sample_rate_hz: float
    """Rate of the frames, Hz."""
    frame_samples: int
    """Length of the frames, samples."""
    low_hz: float
    """Lower end of the band, Hz."""
    high_hz: float
    """Upper end of the band, Hz."""

    def __post_init__(self) -> None:
        if not 0.0 < self.low_hz < self.high_hz <= self.sample_rate_hz / 2:
            raise InputError(
                "band",
                f"{self.low_hz:g} ... {self.high_hz:g} Hz must rise and end at "
                f"or below half the sample rate of {self.sample_rate_hz:g} Hz; lower "
                "the band or record at a higher rate",
            )
        if self.max_lag > (1.0 - _LEAST_OVERLAP) * self.frame_samples:
            raise InputError(
                "microphones",
                f"sound takes {self.shape.max_delay(self.c) * 1e3:.2f} ms across "
                f"the microphones, too long for frames of {self.frame_samples} "
                "samples; use longer frames",
            )

    @cached_property
    def max_lag(self) -> int:
        """Largest delay between any two channels, samples."""
        return math.ceil(self.shape.max_delay(self.c) * self.sample_rate_hz)

    @cached_property
    def edges(self) -> NDArray[np.int64]:
        """(n - 1, 2) pairs of channels that form a tree from channel 0 to all channels.

        The first channel of a pair is channel 0 or the second channel of an earlier
        pair. The microphones of each pair (edge of the tree) are close to each other,
        so that there are few lags to search.
        """
        places = self.shape.p_AM
        gaps = np.linalg.norm(places[:, np.newaxis] - places, axis=2)
        joined, edges = [0], []
        while len(joined) < len(places):
            rest = [k for k in range(len(places)) if k not in joined]
            _, i, j = min((gaps[i, j], i, j) for i in joined for j in rest)
            edges.append((i, j))
            joined.append(j)
        return np.array(edges)

    @cached_property
    def edge_lags(self) -> NDArray[np.int64]:
        """(n - 1,) largest delay along each edge, samples."""
        first, second = self.shape.p_AM[self.edges.T]
        distances = np.linalg.norm(first - second, axis=1)
        return np.ceil(distances / self.c * self.sample_rate_hz).astype(np.int64)

    @cached_property
    def tables(self) -> PairTables:
        """Tables that combine the delays of all pairs."""
        return PairTables.of(self.shape.pairs)

    @cached_property
    def length(self) -> int:
        """Length of the transform, samples, with padding so that lags do not wrap."""
        least = self.frame_samples + int(self.edge_lags.max()) + 2
        # Transforms with many factors of two are the fastest.
        return _TWOS * int(fft.next_fast_len(-(-least // _TWOS)))

    @cached_property
    def band(self) -> slice:
        """Bins of the transform within the band."""
        bins = self.length / self.sample_rate_hz
        first = max(1, math.ceil(self.low_hz * bins))
        return slice(first, min(self.length // 2, math.floor(self.high_hz * bins)) + 1)

    @cached_property
    def grid(self) -> int:
        """Number of samples of a correlation in the first search."""
        least = math.ceil(_GRID_DENSITY * self.band.stop)
        return int(fft.next_fast_len(least, real=True))

    @cached_property
    def gates(self) -> NDArray[np.int64]:
        """(n - 1,) largest lag of each edge in the first search, samples, plus one."""
        exact = self.edge_lags * (self.grid / self.length)
        return np.ceil(exact).astype(np.int64) + 1
