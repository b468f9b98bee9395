"""Medians of values of which some are not known."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def known_medians(values: NDArray[np.float64], axis: int = -1) -> NDArray[np.float64]:
    """Returns the medians along an axis without NaN; NaN where all values are.

    ``np.nanmedian`` does the same. It warns of such places, and takes several times as
    long for a few hundred values, so that live sound would be late.
    """
    number = np.expand_dims(np.isfinite(values).sum(axis=axis), axis)
    # NaN is sorted to the end.
    ordered = np.sort(values, axis=axis)
    low, high = (
        np.take_along_axis(ordered, k, axis=axis).squeeze(axis)
        for k in (np.maximum(number - 1, 0) // 2, number // 2)
    )
    return np.asarray(0.5 * (low + high))
