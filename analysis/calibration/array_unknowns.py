"""The unknowns of an array, scaled by the uncertainties that the user stated."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.array_budget import ArrayBudget
from analysis.arrays.wave_fronts import WaveFront, wave_front
from systems.framework.input_error import InputError

# A direction whose variance is below this share of the largest is taken as exact.
_EXACT = 1e-14


@dataclass(frozen=True)
class ArrayUnknowns:
    """The unknowns of an array: microphone positions, speed of sound, channel delays.

    For n microphones in d dimensions, the full vector holds n d coordinates, the speed
    of sound, and n delays. A delay that all channels share has no effect. The n delays
    therefore add up to 0.
    """

    places: NDArray[np.float64]
    """(n, d) stated microphone positions, m."""
    c: float
    """Stated speed of sound, m/s."""
    budget: ArrayBudget
    """Stated standard deviations of positions, speed of sound and delays."""

    @cached_property
    def origin(self) -> NDArray[np.float64]:
        """(d,) centroid of the microphones, m. Source positions are relative to it."""
        return np.asarray(self.places.mean(axis=0))

    @cached_property
    def scale(self) -> NDArray[np.float64]:
        """Matrix that converts the m unknowns z to changes of the full vector.

        The full vector holds n d microphone coordinates, the speed of sound and n
        delays.

        Returns:
            (n d + 1 + n, m) matrix. Each column is the change of the full vector for
            one standard deviation of one unknown.

        Raises:
            InputError: All uncertainties are stated as 0.
        """
        count = len(self.places)
        variances, axes = np.linalg.eigh(self.budget.of_places)
        kept = variances > _EXACT * max(float(variances[-1]), 1e-30)
        of_places = axes[:, kept] * np.sqrt(variances[kept])
        apart = np.linalg.svd(np.ones((1, count)))[2][1:].T * self.budget.delay_std
        blocks = (of_places, np.array([[self.budget.speed_std]]), apart)
        rows = [len(block) for block in blocks]
        columns = [int(np.any(block)) * block.shape[1] for block in blocks]
        if not any(columns):
            raise InputError(
                "position_std_m",
                "is 0, as are all other uncertainties; state how uncertain the "
                "geometry is, for example 'position_std_m: 0.02'",
            )
        scale = np.zeros((sum(rows), sum(columns)))
        row = column = 0
        for block, high, wide in zip(blocks, rows, columns, strict=True):
            if wide:
                scale[row : row + high, column : column + wide] = block
            row, column = row + high, column + wide
        return scale

    @cached_property
    def prior_covariance(self) -> NDArray[np.float64]:
        """(n d + 1 + n, n d + 1 + n) covariance of the full vector, as stated."""
        return np.asarray(self.scale @ self.scale.T)

    @cached_property
    def stated(self) -> NDArray[np.float64]:
        """(n d + 1 + n,) stated values of the full vector."""
        return np.concatenate((self.places.ravel(), [self.c], self._no_delays))

    @property
    def _no_delays(self) -> NDArray[np.float64]:
        return np.zeros(len(self.places))

    def values(
        self, z: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], float, NDArray[np.float64]]:
        """Converts unknowns to positions, speed of sound and delays.

        Args:
            z: (m,) deviations from the stated values, in standard deviations.

        Returns:
            (n, d) microphone positions, m; the speed of sound, m/s; (n,) delays of the
            channels, s.
        """
        whole = self.stated + self.scale @ z
        size = self.places.size
        places = whole[:size].reshape(self.places.shape)
        return places, float(whole[size]), whole[size + 1 :]

    def front(
        self, z: NDArray[np.float64], h: NDArray[np.float64], w: float
    ) -> tuple[WaveFront, NDArray[np.float64]]:
        """Computes the delays of one source, and their slopes along the unknowns.

        The source is at h / w relative to ``origin``. If h is a position, w is 1. If h
        is a unit vector, w is the inverse range.

        Args:
            z: (m,) deviations from the stated values, in standard deviations.
            h: (d,) position in m, or unit vector to the source, from ``origin``.
            w: 1, or the inverse range, 1/m.

        Returns:
            The wave front, whose delays include those of the channels; and the (n - 1,
            m) slopes of the delays along z, s.
        """
        places, c, late = self.values(z)
        front = wave_front(places - self.origin, max(c, 0.1 * self.c), h, w)
        own = np.eye(len(places))
        slopes = np.hstack(
            (front.by_places, front.by_speed[:, np.newaxis], own[1:] - own[0])
        )
        heard = front.delays + late[1:] - late[0]
        return WaveFront(**{**vars(front), "delays": heard}), slopes @ self.scale
