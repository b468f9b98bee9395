"""Computes votes of the steered response, at the directions where it is greatest.

The steered response measures how well all frequencies together agree on a direction.
Its votes are needed if few times and frequencies contain only one wave. This is the
case for a steady sound in a room. It is also the case if adjacent microphones are too
far apart for the phases of speech.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.steered_response import (
    SearchGrid,
    centroid_delays,
    steered_response,
)
from analysis.arrays.voting.vote_bearings import wrapped
from systems.sound.array_shape import ArrayShape

# _LEAST_SHARE: least height of a peak, as a share of the highest peak.
# _DEVIATIONS: least height of a peak, in standard deviations of the response to noise.
# _MOST_PEAKS: largest number of peaks.
# _LEAST_RESPONSE: least height of a peak in any sound.
_LEAST_SHARE = 0.6
_DEVIATIONS = 5.0
_MOST_PEAKS = 3
_LEAST_RESPONSE = 0.1

# Least distance between two peaks, rad. A nearer peak is the slope of the higher one.
_APART_RAD = math.radians(20.0)

# Largest horizontal component of a direction that is nearly overhead. Sound that all
# microphones have in common lifts the response there, so only its highest peak counts.
_STEEP_LEVEL = 0.35


@dataclass(frozen=True)
class SteeredSearch:
    """Positions to search with the steered response, and the frequencies to use.

    To make a search, call ``SteeredSearch.of``.
    """

    shape: ArrayShape
    c: float
    """Speed of sound, m/s."""
    grid: SearchGrid
    bins: slice
    """Bins of the spectra to use."""
    azimuth: NDArray[np.float64]
    """(g,) azimuth of each position, rad."""
    elevation: NDArray[np.float64]
    """(g,) elevation of each position, rad. NaN if the array cannot measure elevations.
    """
    level: NDArray[np.float64]
    """(g,) horizontal component of the direction of each position, 0 to 1."""

    @classmethod
    def of(
        cls, shape: ArrayShape, c: float, window_s: float, band_hz: tuple[float, float]
    ) -> SteeredSearch:
        """Makes a search over all positions that the array can distinguish."""
        low, high = band_hz
        grid = SearchGrid.of(shape, c, high, window_s)
        p = grid.p_AS
        range_m = np.where(grid.inverse_range > 0.0, np.linalg.norm(p, axis=1), 1.0)
        level = np.hypot(p[:, 0], p[:, 1])
        azimuth = np.arctan2(p[:, 1], p[:, 0])
        elevation = np.full(len(p), np.nan)
        if "elevation" in shape.angles:
            elevation = np.arctan2(p[:, 2], level)
        bins = slice(math.ceil(low * window_s), math.floor(high * window_s) + 1)
        return cls(shape, c, grid, bins, azimuth, elevation, level / range_m)

    def votes(
        self, spectra: NDArray[np.complex64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Finds up to three peaks of the steered response to a group of frames.

        The (f, n, b) spectra contain all b bins from 0. The results are the azimuths
        and elevations of the peaks, rad, and the responses.
        """
        i, j = self.shape.pairs.T
        chosen = spectra[:, :, self.bins]
        cross = np.einsum("fpb,fpb->pb", chosen[:, i].conj(), chosen[:, j])
        size = np.abs(cross)
        cross = np.where(size > 0.0, cross / np.maximum(size, 1e-30), 0.0)
        share = cross.astype(np.complex64) / cross.shape[1]
        correlations = self.grid.correlations(share, self.bins)
        response = steered_response(correlations, self.grid).astype(np.float64)
        steep = self.level < _STEEP_LEVEL
        if "elevation" not in self.shape.angles or not steep[response.argmax()]:
            response[steep] = -1.0
        # Overlapping frames count half, and so do their bins, because neither are
        # independent.
        values = 0.5 * cross.shape[1] * len(spectra) / 2.0
        noise = 1.0 / math.sqrt(2.0 * (self.shape.count - 1) * values)
        least = max(_DEVIATIONS * noise, _LEAST_RESPONSE)
        peaks = self._peaks(response, least)
        azimuth = self.azimuth[peaks] + self._turns(peaks, correlations)
        return wrapped(azimuth), self.elevation[peaks], response[peaks]

    def _peaks(self, response: NDArray[np.float64], least: float) -> NDArray[np.int64]:
        """Returns the positions of the highest peaks whose bearings differ enough."""
        left = response.copy()
        least = max(least, _LEAST_SHARE * float(response.max(initial=0.0)))
        found: list[int] = []
        for _ in range(_MOST_PEAKS):
            best = int(left.argmax())
            if left[best] < least:
                break
            off = self.azimuth - self.azimuth[best]
            near = np.cos(off) > math.cos(_APART_RAD)
            if self.level[best] < _STEEP_LEVEL:
                near |= self._apart(best) < 2.0 * _STEEP_LEVEL
            # If the response is higher just beyond the edge of a removed peak, it is
            # its slope, too.
            if found and response[near].max() > left[best]:
                left[near] = -1.0
                continue
            found.append(best)
            left[near] = -1.0
        return np.array(found, dtype=np.int64)

    def _turns(
        self, peaks: NDArray[np.int64], correlations: NDArray[np.float32]
    ) -> NDArray[np.float64]:
        """Returns by how much the response is greatest beside each position, rad.

        Otherwise, all votes for a source at rest would have the same error, up to half
        a step of the grid. The maximum is that of a parabola through three azimuths.
        """
        grid, step = self.grid, self.grid.angle_rad
        places = np.tile(grid.p_AS[peaks], (3, 1))
        turn = np.repeat(step * np.arange(-1.0, 2.0), len(peaks))
        x, y = places[:, 0].copy(), places[:, 1].copy()
        places[:, 0] = np.cos(turn) * x - np.sin(turn) * y
        places[:, 1] = np.sin(turn) * x + np.cos(turn) * y
        inverse_range = np.tile(grid.inverse_range[peaks], 3)
        later = centroid_delays(places, inverse_range, self.shape, self.c)
        i, j = self.shape.pairs.T
        lags = grid.lag_rate_hz * (later[:, j] - later[:, i]) + grid.max_lag
        lags = np.clip(lags, 0.0, correlations.shape[1] - 1.000001)
        below, pair = lags.astype(np.int64), np.arange(len(i))
        above = lags - below
        values = correlations[pair, below] * (1.0 - above)
        values += correlations[pair, below + 1] * above
        before, here, after = values.sum(axis=1).reshape(3, -1)
        bend = before - 2.0 * here + after
        off = 0.5 * (before - after) / np.where(bend < 0.0, bend, -np.inf)
        return np.asarray(step * np.clip(off, -1.0, 1.0))

    def _apart(self, k: int) -> NDArray[np.float64]:
        """Returns the horizontal distances of all directions from direction k."""
        across = self.level * np.exp(1j * self.azimuth)
        return np.asarray(np.abs(across - across[k]))
