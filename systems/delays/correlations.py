"""Computes correlations of channels from their cross-spectra."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import fft

# Share of the mean of the cross-spectrum. Where the cross-spectrum is below this share,
# the whitened spectrum decreases to zero. Otherwise bins of noise would count as much
# as bins of sound.
_PHAT_FLOOR = 0.1


def whitening(cross: NDArray[np.complex64]) -> NDArray[np.float32]:
    """Computes the weights of the phase transform for (pairs, bins) cross-spectra."""
    size = np.abs(cross)
    floor = _PHAT_FLOOR * size.mean(axis=-1, keepdims=True)
    return 1.0 / (size + floor + np.finfo(np.float32).tiny)


def correlations_at_lags(
    cross: NDArray[Any], band: slice, length: int, reach: int
) -> NDArray[Any]:
    """Computes the correlations of pairs of channels up to a largest lag.

    Args:
        cross: (p, bins) cross-spectra within the band, single or double precision.
        band: Bins of the transform that ``cross`` contains. All other bins are zero.
        length: Length of the transform, in columns of the result.
        reach: Largest lag in either direction, in columns of the result.

    Returns:
        (p, 2 reach + 1) correlations, with lag 0 in the middle. The precision is that
        of ``cross``.
    """
    whole = np.zeros((len(cross), length // 2 + 1), dtype=cross.dtype)
    whole[:, band] = cross
    values = fft.irfft(whole, length)
    return np.concatenate((values[:, -reach:], values[:, : reach + 1]), axis=1)


def parabola_vertex(left: Any, top: Any, right: Any) -> Any:
    """Computes where the parabola through three values has its maximum.

    Args:
        left: Values one step before ``top``; numbers or arrays of one shape.
        top: Values in the middle.
        right: Values one step after ``top``.

    Returns:
        Position of the maximum relative to ``top``, -1 to 1 step. It is 0 if the
        parabola has no maximum.
    """
    bend = left - 2.0 * top + right
    shift = 0.5 * (left - right) / np.minimum(bend, -1e-30)
    return np.where(bend < 0.0, np.clip(shift, -1.0, 1.0), 0.0)
