"""What is wrong with an array that was built: places, delays and gains."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from systems.adc import MicArrayParameters

__all__ = ["Tolerances", "draw_tolerances"]


@dataclass(frozen=True)
class Tolerances:
    """Errors of the n channels of one array."""

    position_errors: NDArray[np.float64]
    """(n, 2) true less stated places of the microphones, in B axes, m."""
    channel_delays: NDArray[np.float64]
    """(n,) by which each channel is sampled later than stated, s."""
    gains: NDArray[np.float64]
    """(n,) true over stated gain of each channel, a ratio of amplitudes."""


def draw_tolerances(
    parameters: MicArrayParameters, count: int, generator: Generator
) -> Tolerances:
    """Errors of one array, each uniform within its tolerance of either sign.

    Args:
        parameters: The tolerances.
        count: Number of microphones n.
        generator: Where the errors come from.
    """
    places = generator.uniform(-1.0, 1.0, (count, 2))
    delays = generator.uniform(-1.0, 1.0, count)
    gains_db = generator.uniform(-1.0, 1.0, count) * parameters.gain_tolerance_db
    return Tolerances(
        position_errors=places * parameters.position_tolerance_m,
        channel_delays=delays * parameters.delay_tolerance_s,
        gains=10.0 ** (gains_db / 20.0),
    )
