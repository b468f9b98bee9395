"""The true properties of a microphone array, which may differ from the stated ones."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from systems.sound.parameters import MicArrayParameters

# Largest spacing of the knots of a delay polynomial, s. Between two knots, the delay
# deviates from a cubic polynomial by less than 1e-4 sample. This bound holds even if
# the robot turns at 4 rad/s.
_SPACING_S = 0.0025


@dataclass(frozen=True)
class ChannelErrors:
    """Errors of the n channels of an array."""

    position_errors: NDArray[np.float64]
    """(n, 2) true positions minus stated positions of the microphones, in the axes of
    the body frame B, m."""
    channel_delays: NDArray[np.float64]
    """(n,) times by which the channels are sampled later than stated, s."""
    gains: NDArray[np.float64]
    """(n,) true gain divided by stated gain of each channel; 1 means no error."""


def no_errors(count: int) -> ChannelErrors:
    """Returns the errors of a perfect array with a number of channels."""
    return ChannelErrors(np.zeros((count, 2)), np.zeros(count), np.ones(count))


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
    errors: ChannelErrors,
    c: float,
) -> RealArray:
    """Computes the true properties of an array from its stated properties and errors.

    Args:
        p_BM: (n, 2) stated positions of the microphones in the body frame B, m.
        parameters: Length of an audio frame.
        errors: Errors of positions, delays and gains.
        c: Speed of sound, m/s.

    Returns:
        The true array.
    """
    spans = math.ceil(parameters.frame_s / _SPACING_S - 1e-9)
    while parameters.frame_samples % spans:
        spans += 1
    knots = np.linspace(0.0, parameters.frame_s, spans + 1)
    instants = knots + errors.channel_delays[:, None]
    return RealArray(p_BM + errors.position_errors, instants, errors.gains, c)
