"""Computes errors of delays due to echoes that remain after their suppression."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from systems.sound.array_shape import ArrayShape

# Echoes that remain are mainly reflections off the floor. The values below are from the
# trials in rooms, docs/results_hearing.md.
# Standard deviation of the independent shift of each arrival by echoes, s.
_ARRIVAL_S = 1.2e-6
# Standard deviation of the turn of the whole direction by echoes, rad.
_DIRECTION_RAD = 2e-3
# Least share of a frame's energy that is no echo, for which these standard deviations
# apply. For smaller shares, the errors are larger.
_NEWS = 0.12

# Root mean square angular frequency at which the errors above apply, rad/s. An echo
# with the delay d shifts the peak of a correlation in proportion to 1 / (w^2 d). The
# phase of the echo varies with the frequency w within the band, so that most of its
# effect cancels.
_BAND = 2.0 * math.pi * 4.5e3

# Number of parts into which a frame is divided. Fewer parts detect the start of a sound
# less well. With more parts, noise in a narrow band causes more false detections.
_PARTS = 5


def echo_errors(
    shape: ArrayShape, c: float, news: float, angular_frequency: float
) -> NDArray[np.float64]:
    """Computes the covariance of delays due to echoes that were not fully suppressed.

    Args:
        shape: The n microphones.
        c: Speed of sound, m/s.
        news: Share of the energy of the audio frame that is not from echoes, above 0.
        angular_frequency: Root mean square angular frequency of the remaining sound,
            rad/s.

    Returns:
        (n - 1, n - 1) covariance of the delays of channels 1 ... n - 1 relative to
        channel 0, s^2.
    """
    turns = (shape.p_AM[1:] - shape.p_AM[0]) * (_DIRECTION_RAD / c)
    single = _ARRIVAL_S**2 * (np.eye(len(turns)) + 1.0)
    scale = max(1.0, _BAND / angular_frequency) ** 2 * max(1.0, _NEWS / news)
    return (single + turns @ turns.T) * scale**2


def energy_spread(frame: NDArray[np.float32]) -> float:
    """Computes over which share of an audio frame its energy is spread.

    The function divides the frame into five parts. The result is the squared mean of
    their energies, divided by the mean of their squared energies. For example, if a
    steady sound fills the share p of an otherwise silent frame, the result is about p.

    Args:
        frame: (n, samples) channels, not all silent.

    Returns:
        Share, 0.2 to 1.
    """
    parts = np.array_split(frame, _PARTS, axis=1)
    energy = np.array([float(np.vdot(part, part)) for part in parts])
    return float(energy.sum() ** 2 / (_PARTS * (energy**2).sum()))
