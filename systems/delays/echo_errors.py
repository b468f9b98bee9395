"""What echoes that slip through the precedence effect do to delays."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from systems.sound.array_shape import ArrayShape

# Such echoes, those off the floor above all, shift each arrival by itself
# (standard deviation, s) and the whole direction (rad). The less of a frame is
# news, the more: from this share on they count fully. All from the trials in
# rooms, docs/results_hearing.md.
_ARRIVAL_S = 1.2e-6
_DIRECTION_RAD = 2e-3
_NEWS = 0.12

# An echo d later shifts the peak of a correlation in proportion to 1 / (w^2 d), for
# over the band w its phase turns and the rest cancels: the errors above are those
# of this root mean square frequency, rad/s.
_BAND = 2.0 * math.pi * 4.5e3

# Fewer parts see a sound begin less well, more are fooled by noise of a narrow band.
_PARTS = 5


def echo_errors(
    shape: ArrayShape, c: float, news: float, angular_frequency: float
) -> NDArray[np.float64]:
    """Covariance of the delays of a frame whose echoes were suppressed.

    Args:
        shape: The microphones.
        c: Speed of sound, m/s.
        news: Share of the frame's energy that is no echo, above 0.
        angular_frequency: Root mean square of the sound that is left, rad/s.

    Returns:
        (n - 1, n - 1) of the channels 1 ... n - 1 against channel 0, s^2.
    """
    turns = (shape.p_AM[1:] - shape.p_AM[0]) * (_DIRECTION_RAD / c)
    single = _ARRIVAL_S**2 * (np.eye(len(turns)) + 1.0)
    scale = max(1.0, _BAND / angular_frequency) ** 2 * max(1.0, _NEWS / news)
    return (single + turns @ turns.T) * scale**2


def energy_spread(frame: NDArray[np.float32]) -> float:
    """Share of a frame that its energy is spread over.

    The square of the energy's mean over its mean square, between fifths of the
    frame: p for a steady sound in a share p of silence.

    Args:
        frame: (n, samples) channels, not all silent.

    Returns:
        0.2 to 1.
    """
    parts = np.array_split(frame, _PARTS, axis=1)
    energy = np.array([float(np.vdot(part, part)) for part in parts])
    return float(energy.sum() ** 2 / (_PARTS * (energy**2).sum()))
