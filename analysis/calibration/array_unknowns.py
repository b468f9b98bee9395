"""The unknowns of an array, in deviations of what is stated of it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.array_budget import ArrayBudget
from analysis.calibration.wave_fronts import WaveFront, wave_front
from systems.framework.input_error import InputError

# Directions with less than this share of the largest variance are known exactly.
_EXACT = 1e-14


@dataclass(frozen=True)
class ArrayUnknowns:
    """Places of n microphones, speed of sound and the channels' delays.

    They are stacked as n d coordinates, the speed, and n delays. What all channels
    are late by together has no meaning: the delays add up to 0.
    """

    places: NDArray[np.float64]
    """(n, d) stated, m."""
    c: float
    """Stated speed of sound, m/s."""
    budget: ArrayBudget

    @cached_property
    def origin(self) -> NDArray[np.float64]:
        """(d,) of the frame in which sources are looked for: the centroid, m."""
        return np.asarray(self.places.mean(axis=0))

    @cached_property
    def scale(self) -> NDArray[np.float64]:
        """(n d + 1 + n, m) changes of all for one deviation of each unknown.

        Raises:
            InputError: All is stated to be exact.
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
        """(n d + 1 + n, same) of all, as stated."""
        return np.asarray(self.scale @ self.scale.T)

    @cached_property
    def stated(self) -> NDArray[np.float64]:
        """(n d + 1 + n,) of all, as stated."""
        return np.concatenate((self.places.ravel(), [self.c], self._no_delays))

    @property
    def _no_delays(self) -> NDArray[np.float64]:
        return np.zeros(len(self.places))

    def values(
        self, z: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], float, NDArray[np.float64]]:
        """What unknowns stand for.

        Args:
            z: (m,) deviations from what is stated.

        Returns:
            (n, d) places, m; the speed of sound, m/s; (n,) delays of channels, s.
        """
        whole = self.stated + self.scale @ z
        size = self.places.size
        places = whole[:size].reshape(self.places.shape)
        return places, float(whole[size]), whole[size + 1 :]

    def front(
        self, z: NDArray[np.float64], h: NDArray[np.float64], w: float
    ) -> tuple[WaveFront, NDArray[np.float64]]:
        """Delays at the array of a source, and their slopes along the unknowns.

        Args:
            z: (m,) deviations from what is stated.
            h: (d,) place from ``origin`` times w.
            w: 1, or the inverse range, 1/m.

        Returns:
            The wave front, the channels' own delays added, and slopes (n - 1, m).
        """
        places, c, late = self.values(z)
        front = wave_front(places - self.origin, max(c, 0.1 * self.c), h, w)
        own = np.eye(len(places))
        slopes = np.hstack(
            (front.by_places, front.by_speed[:, np.newaxis], own[1:] - own[0])
        )
        heard = front.delays + late[1:] - late[0]
        return WaveFront(**{**vars(front), "delays": heard}), slopes @ self.scale
