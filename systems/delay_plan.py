"""Sizes of the transforms that measure delays."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

from scipy import fft

__all__ = ["DelayPlan"]

# Samples a period of the highest frequency on the grid of the first search.
_GRID_DENSITY = 5.0

# Left of a frame after the cut, as a share; a longer delay cannot be measured.
_LEAST_OVERLAP = 0.25


@dataclass(frozen=True)
class DelayPlan:
    """What can be worked out before the first frame.

    Raises:
        ValueError: Band, frame and spacing do not fit the sample rate.
    """

    sample_rate_hz: float
    """Rate of the frames, Hz."""
    frame_samples: int
    """Length of the frames."""
    max_delay_s: float
    """Largest delay between neighbours, spacing / c, s."""
    low_hz: float
    """Lower end of the band, Hz."""
    high_hz: float
    """Upper end of the band, Hz."""

    def __post_init__(self) -> None:
        if not 0.0 < self.low_hz < self.high_hz <= self.sample_rate_hz / 2:
            raise ValueError(
                f"band: {self.low_hz:g} ... {self.high_hz:g} Hz must rise and end at "
                f"or below half the sample rate of {self.sample_rate_hz:g} Hz; lower "
                "the band or record at a higher rate"
            )
        if 2 * self.max_lag > (1.0 - _LEAST_OVERLAP) * self.frame_samples:
            raise ValueError(
                f"spacing: sound needs {self.max_delay_s * 1e3:.2f} ms from microphone "
                f"to microphone, too long for frames of {self.frame_samples} samples; "
                "use longer frames"
            )

    @property
    def max_lag(self) -> int:
        """Largest delay between neighbours, samples."""
        return math.ceil(self.max_delay_s * self.sample_rate_hz)

    @cached_property
    def length(self) -> int:
        """Samples of the Fourier transform, padded so that lags do not wrap."""
        least = self.frame_samples + self.max_lag + 2
        return int(fft.next_fast_len(least, real=True))

    @cached_property
    def band(self) -> slice:
        """Bins of the transform within the band."""
        bins = self.length / self.sample_rate_hz
        first = max(1, math.ceil(self.low_hz * bins))
        return slice(first, min(self.length // 2, math.floor(self.high_hz * bins)) + 1)

    @cached_property
    def grid(self) -> int:
        """Samples of the correlation in the first search."""
        least = math.ceil(_GRID_DENSITY * self.band.stop)
        return int(fft.next_fast_len(least, real=True))

    @cached_property
    def gate(self) -> int:
        """Largest lag on that grid, one more than sound can take."""
        return math.ceil(self.max_lag * self.grid / self.length) + 1
