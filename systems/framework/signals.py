"""What travels through the abstract ports: emitted sound and recorded audio."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

#: Period of a robot's control, and of its frames, unless a scenario says another, s
#: (Han 2019, section 4.1; printed "25 m/s").
TICK_S = 0.025


#: Rate at which sound is computed, and that of the converter unless its parameters
#: say another (Han 2019, section 4.1).
SAMPLE_RATE_HZ = 100_000

#: Samples a channel in a frame of ``TICK_S`` at ``SAMPLE_RATE_HZ``.
FRAME_SAMPLES = round(TICK_S * SAMPLE_RATE_HZ)


def whole(count: float) -> bool:
    """Whether a number of ticks or samples is a whole one, but for rounding."""
    return round(count) >= 1 and abs(count - round(count)) < 1e-6


def read_only(*arrays: NDArray[Any]) -> None:
    """Protects arrays that are shared from being written to."""
    for array in arrays:
        array.setflags(write=False)


class Emission(NamedTuple):
    """Sound that has left the loudspeaker, and where it left from.

    Sample ``n`` was emitted at ``start_time + n / sample_rate_hz``. The
    emitter's path is given at knots, position and velocity, to be joined by
    cubic Hermite polynomials.
    """

    samples: NDArray[np.float32]
    """(n,) sound pressure at 1 m, Pa."""
    start_time: float
    """Time of the first sample, s."""
    sample_rate_hz: float
    """Rate of ``samples``, Hz."""
    knot_times: NDArray[np.float64]
    """(k,) ascending; the last one is the time of publication, s."""
    p_WS: NDArray[np.float64]
    """(k, 2) emitter position in W, m."""
    v_WS: NDArray[np.float64]
    """(k, 2) emitter velocity in W, m/s."""
    level_pa: float
    """RMS pressure at 1 m while the source sounds, Pa; noise refers to it."""
    sounding: bool
    """False where every sample is zero, so that listeners may skip it."""

    def __deepcopy__(self, memo: dict[int, Any]) -> Emission:
        """Itself: Drake would copy a frame's memory with every context."""
        return self


class AudioFrame(NamedTuple):
    """A frame of converter counts, which ends at ``time``."""

    counts: NDArray[np.int16]
    """(channels, samples), channels first."""
    full_scale: int
    """Counts that stand for the converter's positive full scale."""
    sample_rate_hz: float
    """Rate of each channel, Hz."""
    time: float
    """End of the frame, s."""

    def __deepcopy__(self, memo: dict[int, Any]) -> AudioFrame:
        """Itself, as ``Emission``."""
        return self
