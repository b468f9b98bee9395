"""Votes of the steered response: where all frequencies together agree best.

They serve where too few times and frequencies hold a single wave alone: a steady sound
in a room, or an array whose neighbours are too far apart for phases of speech.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from analysis.arrays.steered_response import LAG_DENSITY, SearchGrid, steered_response
from systems.delays.correlations import correlations_at_lags
from systems.sound.array_shape import ArrayShape

# A frame's peaks count above this share of its highest, and above so many deviations
# of what noise gives.
_LEAST_SHARE = 0.6
_DEVIATIONS = 5.0
_MOST_PEAKS = 3
_LEAST_RESPONSE = 0.1

# Peaks nearer than this to a higher one are its slopes.
_APART_RAD = math.radians(20.0)

_LEAST_LEVEL = 0.35


@dataclass(frozen=True)
class SteeredSearch:
    """Places that are searched, and the frequencies that count.

    Make one by ``SteeredSearch.of``.
    """

    shape: ArrayShape
    grid: SearchGrid
    bins: slice
    """Of the spectra."""
    length: int
    """Samples of a correlation."""
    azimuth: NDArray[np.float64]
    """(g,) of the places, rad; NaN nearly overhead."""
    elevation: NDArray[np.float64]
    """(g,) rad."""

    @classmethod
    def of(
        cls, shape: ArrayShape, c: float, window_s: float, band_hz: tuple[float, float]
    ) -> SteeredSearch:
        """A search over all places that the array tells apart.

        Args:
            shape: The microphones.
            c: Speed of sound, m/s.
            window_s: Length of the frames, s.
            band_hz: Lowest and highest frequency that counts, Hz.

        Returns:
            The search.
        """
        low, high = band_hz
        length = int(
            fft.next_fast_len(math.ceil(LAG_DENSITY * high * window_s), real=True)
        )
        grid = SearchGrid.of(shape, c, high, length / window_s)
        p = grid.p_AS
        range_m = np.where(grid.inverse_range > 0.0, np.linalg.norm(p, axis=1), 1.0)
        level = np.hypot(p[:, 0], p[:, 1])
        azimuth = np.arctan2(p[:, 1], p[:, 0])
        azimuth[level < _LEAST_LEVEL * range_m] = np.nan
        elevation = np.full(len(p), np.nan)
        if "elevation" in shape.angles:
            elevation = np.arctan2(p[:, 2], level)
        bins = slice(math.ceil(low * window_s), math.floor(high * window_s) + 1)
        return cls(shape, grid, bins, length, azimuth, elevation)

    def votes(
        self, spectra: NDArray[np.complex64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Peaks of the response to a few frames together.

        Args:
            spectra: (f, n, b) frames, channels, all bins from 0 on.

        Returns:
            (k,) azimuths, (k,) elevations, rad, and (k,) responses of up to three
            peaks: none where nothing stands out.
        """
        i, j = self.shape.pairs.T
        chosen = spectra[:, :, self.bins]
        cross = np.einsum("fpb,fpb->pb", chosen[:, i].conj(), chosen[:, j])
        size = np.abs(cross)
        cross = np.where(size > 0.0, cross / np.maximum(size, 1e-30), 0.0)
        response = self._response(cross.astype(np.complex64))
        response[np.isnan(self.azimuth)] = -1.0
        # Frames that overlap are worth half; their bins are not independent either.
        values = 0.5 * cross.shape[1] * len(spectra) / 2.0
        noise = 1.0 / math.sqrt(2.0 * (self.shape.count - 1) * values)
        least = max(_DEVIATIONS * noise, _LEAST_RESPONSE)
        peaks = self._peaks(response, least)
        return self.azimuth[peaks], self.elevation[peaks], response[peaks]

    def _response(self, cross: NDArray[np.complex64]) -> NDArray[np.float64]:
        share = cross / cross.shape[1]
        gated = correlations_at_lags(share, self.bins, self.length, self.grid.max_lag)
        gated = gated * np.float32(0.5 * self.length)
        return steered_response(gated, self.grid).astype(np.float64)

    def _peaks(self, response: NDArray[np.float64], least: float) -> NDArray[np.int64]:
        """The highest places whose bearings are apart."""
        left = response.copy()
        least = max(least, _LEAST_SHARE * float(response.max(initial=0.0)))
        found: list[int] = []
        for _ in range(_MOST_PEAKS):
            best = int(left.argmax())
            if left[best] < least:
                break
            off = self.azimuth - self.azimuth[best]
            near = np.cos(off) > math.cos(_APART_RAD)
            # What is higher just beyond the edge is a slope, too.
            if found and response[near].max() > left[best]:
                left[near] = -1.0
                continue
            found.append(best)
            left[near] = -1.0
        return np.array(found, dtype=np.int64)
