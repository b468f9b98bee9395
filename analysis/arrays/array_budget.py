"""What is not known of an array and of the air, and what that does to delays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from systems.sound.array_shape import ArrayShape


@dataclass(frozen=True)
class ArrayBudget:
    """Standard deviations of what the geometry of n microphones states.

    They are one draw for a whole recording: no average over time makes them smaller.
    """

    of_places: NDArray[np.float64]
    """(n d, n d) covariance of the microphones' places, one after another, m^2."""
    speed_std: float
    """Of the speed of sound, m/s."""
    delay_std: float
    """Of each channel's instants of sampling, s."""

    @classmethod
    def of(
        cls,
        shape: ArrayShape,
        position_std: float,
        speed_std: float = 0.0,
        delay_std: float = 0.0,
    ) -> ArrayBudget:
        """A budget with places that are uncertain alike in all directions.

        Args:
            shape: The microphones.
            position_std: Of each coordinate of each microphone, m.
            speed_std: Of the speed of sound, m/s.
            delay_std: Of each channel's instants of sampling, s.

        Returns:
            The budget.
        """
        of_places = position_std**2 * np.eye(shape.p_AM.size)
        return cls(of_places, speed_std, delay_std)

    @property
    def position_std(self) -> float:
        """Root mean square of the coordinates' standard deviations, m."""
        return float(np.sqrt(np.trace(self.of_places) / len(self.of_places)))

    def delay_covariance(
        self, u: NDArray[np.float64], w: float, shape: ArrayShape, c: float
    ) -> NDArray[np.float64]:
        """Covariance of the delays t_k - t_0 of sound from one place.

        To first order: a microphone that stands nearer to the source by some
        length hears it earlier by that over c.

        Args:
            u: (d,) unit vector to the source from the microphones' centroid.
            w: Inverse range, 1/m; 0 for a source far away.
            shape: The n microphones.
            c: Speed of sound, m/s.

        Returns:
            (n - 1, n - 1) s^2.
        """
        count, dimension = shape.p_AM.shape
        to_source = u - w * shape.p_AM
        to_source /= np.linalg.norm(to_source, axis=1, keepdims=True)
        slopes = np.zeros((count, count, dimension))
        slopes[np.arange(count), np.arange(count)] = -to_source / c
        slopes = slopes[1:] - slopes[0]
        flat = slopes.reshape(count - 1, -1)
        later = _arrivals(u, w, shape) / c
        delays = later[1:] - later[0]
        return (
            flat @ self.of_places @ flat.T
            + (self.speed_std / c) ** 2 * np.outer(delays, delays)
            + self.delay_std**2 * (np.eye(count - 1) + 1.0)
        )


def _arrivals(
    u: NDArray[np.float64], w: float, shape: ArrayShape
) -> NDArray[np.float64]:
    """(n,) how much farther the microphones are than their centroid, m."""
    along = shape.p_AM @ u
    square = np.sum(shape.p_AM**2, axis=1)
    ratio = np.sqrt(np.maximum(1.0 - 2.0 * w * along + w * w * square, 0.0))
    return (w * square - 2.0 * along) / (ratio + 1.0)
