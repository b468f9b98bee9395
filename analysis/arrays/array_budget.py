"""Describes the errors of an array and of the air, and their effect on delays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from systems.sound.array_shape import ArrayShape


def rotations(places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns the displacements of (n, d) microphones if the array turns by 1 rad.

    The (n d, r) columns are turns about the axes x, y and z, or about z only in the
    plane, to first order.
    """
    count, dimension = places.shape
    p = np.pad(places - places.mean(axis=0), ((0, 0), (0, 3 - dimension)))
    axes = np.eye(3) if dimension == 3 else np.eye(3)[2:]
    turns = [np.cross(axis, p)[:, :dimension].ravel() for axis in axes]
    return np.stack(turns, axis=1).reshape(count * dimension, -1)


@dataclass(frozen=True)
class ArrayBudget:
    """Standard deviations of the errors in the description of n microphones.

    The errors are constant during a recording. Averaging over time does not reduce
    them.
    """

    of_places: NDArray[np.float64]
    """(n d, n d) covariance of the microphone coordinates, m^2. All d coordinates of a
    microphone are adjacent."""
    speed_std: float
    """Standard deviation of the speed of sound, m/s."""
    delay_std: float
    """Standard deviation of the sampling times of each channel, s."""

    @property
    def position_std(self) -> float:
        """Root mean square of the coordinates' standard deviations, m."""
        return float(np.sqrt(np.trace(self.of_places) / len(self.of_places)))

    def delay_covariance(
        self, u: NDArray[np.float64], w: float, shape: ArrayShape, c: float
    ) -> NDArray[np.float64]:
        """Computes the (n - 1, n - 1) covariance of the delays t_k - t_0, s^2.

        The unit vector u points from the centroid of the microphones to the source. The
        inverse range w is 0 for a distant source, 1/m. The computation is to first
        order: if a microphone is nearer to the source by a length, the sound arrives
        earlier by this length divided by c.
        """
        count, dimension = shape.p_AM.shape
        to_source = u - w * shape.p_AM
        to_source /= np.linalg.norm(to_source, axis=1, keepdims=True)
        slopes = np.zeros((count, count, dimension))
        slopes[np.arange(count), np.arange(count)] = -to_source / c
        slopes = slopes[1:] - slopes[0]
        flat = slopes.reshape(count - 1, -1)
        along = shape.p_AM @ u
        square = np.sum(shape.p_AM**2, axis=1)
        ratio = np.sqrt(np.maximum(1.0 - 2.0 * w * along + w * w * square, 0.0))
        later = (w * square - 2.0 * along) / (ratio + 1.0) / c
        delays = later[1:] - later[0]
        return (
            flat @ self.of_places @ flat.T
            + (self.speed_std / c) ** 2 * np.outer(delays, delays)
            + self.delay_std**2 * (np.eye(count - 1) + 1.0)
        )
