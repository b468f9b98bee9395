"""Finds the part of the spectrum that a sound occupies."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Width over which spectra are smoothed. Without smoothing, the power in a bin of one
# frame scatters by 100 %.
_SMOOTHING_HZ = 400.0

# Least ratio of the power of a sound to the floor: 6 dB.
_ABOVE_FLOOR = 4.0

# The floor is this quantile of the smoothed power in the band.
_FLOOR_QUANTILE = 0.25

# Least width of the occupied part. If a sound occupies less, as a tone does, the whole
# band is used.
_LEAST_WIDTH_HZ = 500.0


def occupied_band(spectra: NDArray[np.complex64], bin_hz: float) -> tuple[int, int]:
    """Finds the range of frequency bins in which a sound is above the noise floor.

    Args:
        spectra: (channels, bins) spectra within the band.
        bin_hz: Width of a bin, Hz.

    Returns:
        First bin of the range, and the bin after its last bin. If the sound fills the
        band, or if too few bins are above the floor, the range contains all bins.
    """
    bins = spectra.shape[1]
    width = max(1, round(_SMOOTHING_HZ / bin_hz))
    power = np.mean(np.abs(spectra) ** 2, axis=0, dtype=np.float64)
    smooth = np.convolve(power, np.full(width, 1.0 / width), mode="same")
    occupied = np.flatnonzero(
        smooth > _ABOVE_FLOOR * np.quantile(smooth, _FLOOR_QUANTILE)
    )
    if occupied.size * bin_hz < _LEAST_WIDTH_HZ:
        return 0, bins
    return int(occupied[0]), int(occupied[-1]) + 1
