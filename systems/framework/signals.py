"""Defines the objects on abstract ports (sound and audio) and the basic rates."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

#: Default period of the control and of the audio frames, s (Han 2019, section 4.1,
#: which prints "25 m/s").
TICK_S = 0.025


#: Sample rate of the simulated sound, and default sample rate of the A/D converter, Hz
#: (Han 2019, section 4.1).
SAMPLE_RATE_HZ = 100_000

#: Samples per channel in a frame of ``TICK_S`` at ``SAMPLE_RATE_HZ``.
FRAME_SAMPLES = round(TICK_S * SAMPLE_RATE_HZ)


def whole(count: float) -> bool:
    """Returns whether a number is a positive integer, apart from rounding errors."""
    return round(count) >= 1 and abs(count - round(count)) < 1e-6


def read_only(*arrays: NDArray[Any]) -> None:
    """Makes shared arrays read-only."""
    for array in arrays:
        array.setflags(write=False)


class Emission(NamedTuple):
    """Sound that a loudspeaker emitted, and the path of the loudspeaker.

    The loudspeaker emitted sample n at the time ``start_time + n / sample_rate_hz``.
    The path has knots with position and velocity. Cubic Hermite polynomials connect the
    knots.
    """

    samples: NDArray[np.float32]
    """(n,) sound pressure at a distance of 1 m, Pa."""
    start_time: float
    """Time of the first sample, s."""
    sample_rate_hz: float
    """Rate of ``samples``, Hz."""
    knot_times: NDArray[np.float64]
    """(k,) ascending times, s. The last one is the time of publication."""
    p_WS: NDArray[np.float64]
    """(k, 2) position of the loudspeaker in W, m."""
    v_WS: NDArray[np.float64]
    """(k, 2) velocity of the loudspeaker in W, m/s."""
    level_pa: float
    """RMS pressure at 1 m while the source sounds, Pa. The noise levels of the
    microphones are relative to this pressure."""
    sounding: bool
    """False if all samples are zero, so that listeners may skip them."""

    def __deepcopy__(self, memo: dict[int, Any]) -> Emission:
        """Returns the same object, so that contexts do not copy the samples."""
        return self


class AudioFrame(NamedTuple):
    """A frame of counts of the A/D converter."""

    counts: NDArray[np.int16]
    """(channels, samples) counts."""
    full_scale: int
    """Number of counts at the positive full scale of the converter."""
    sample_rate_hz: float
    """Rate of each channel, Hz."""
    time: float
    """End of the frame, s."""

    def __deepcopy__(self, memo: dict[int, Any]) -> AudioFrame:
        """Returns the same object, as for ``Emission``."""
        return self
