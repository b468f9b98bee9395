"""Draws errors of a real microphone array: positions, delays and gains."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from systems.sound.parameters import MicArrayParameters, channel_skew

# Largest spacing of the knots of a delay polynomial, s. Between two knots, the delay
# deviates from a cubic polynomial by less than 1e-4 sample. This bound holds even if
# the robot turns at 4 rad/s.
_SPACING_S = 0.0025


@dataclass(frozen=True)
class Tolerances:
    """Errors of the n channels of an array."""

    position_errors: NDArray[np.float64]
    """(n, 2) true positions minus stated positions of the microphones, in the axes of
    the body frame B, m."""
    channel_delays: NDArray[np.float64]
    """(n,) times by which the channels are sampled later than stated, s."""
    gains: NDArray[np.float64]
    """(n,) true gain divided by stated gain of each channel; 1 means no error."""


def draw_tolerances(
    parameters: MicArrayParameters, count: int, generator: Generator
) -> Tolerances:
    """Draws the errors of one array, uniformly distributed within its tolerances.

    Args:
        parameters: The tolerances.
        count: Number of microphones n.
        generator: Source of the random numbers.

    Returns:
        Errors of n positions, n delays, and n gains.
    """
    places = generator.uniform(-1.0, 1.0, (count, 2))
    delays = generator.uniform(-1.0, 1.0, count)
    gains_db = generator.uniform(-1.0, 1.0, count) * parameters.gain_tolerance_db
    return Tolerances(
        position_errors=places * parameters.position_tolerance_m,
        channel_delays=delays * parameters.delay_tolerance_s,
        gains=10.0 ** (gains_db / 20.0),
    )


class RealArray(NamedTuple):
    """True properties of array and air, which may differ from the stated ones."""

    p_BM: NDArray[np.float64]
    """(n, 2) positions of the microphones in B, m."""
    instants: NDArray[np.float64]
    """(n, k) times after the start of a frame, s. For each channel, they are the k
    times at which the travel time of the sound is computed exactly (knots of
    ``propagate``)."""
    gains: NDArray[np.float64]
    """(n,) true gain divided by stated gain of each channel."""
    c: float
    """Speed of sound, m/s."""


def real_array(
    p_BM: NDArray[np.float64],
    parameters: MicArrayParameters,
    tolerances: Tolerances,
    c: float,
) -> RealArray:
    """Computes the true properties of an array from its stated properties and errors.

    Args:
        p_BM: (n, 2) stated positions of the microphones in the body frame B, m.
        parameters: Stated sampling delays (skew) of the channels, and length of an
            audio frame.
        tolerances: Errors of positions, delays and gains.
        c: Speed of sound, m/s.

    Returns:
        The true array.

    Raises:
        ValueError: The number of stated delays differs from the number of microphones.
    """
    late = channel_skew(parameters, len(p_BM)) + tolerances.channel_delays
    spans = math.ceil(parameters.frame_s / _SPACING_S - 1e-9)
    while parameters.frame_samples % spans:
        spans += 1
    knots = np.linspace(0.0, parameters.frame_s, spans + 1)
    instants = knots + late[:, None]
    return RealArray(p_BM + tolerances.position_errors, instants, tolerances.gains, c)
