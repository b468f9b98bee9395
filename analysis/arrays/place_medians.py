"""Computes medians of estimated values and angles, with their errors."""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence

import numpy as np

from analysis.arrays.recording_search import MAD_TO_STD

# Least error that counts in a weighted median, as a share of the median error.
_LEAST_ERROR = 0.3

Measured = tuple[float | None, float | None]


def median(estimates: Sequence[Measured]) -> Measured:
    """Returns the weighted median of values, and the error of a single value.

    Each estimate is a value and its standard deviation. The weight of a value is
    the inverse square of its error. A larger number of values does not reduce the error
    of the result, because the values may have a common error. The error is the scatter
    of the values around the median, or the median of their standard deviations,
    whichever is larger.
    """
    rows = [row for row in estimates if row[0] is not None and row[1] is not None]
    if not rows:
        return None, None
    values, errors = np.array(rows, dtype=np.float64).T
    weights = 1.0 / np.maximum(errors, _LEAST_ERROR * np.median(errors)) ** 2
    order = np.argsort(values)
    below = np.cumsum(weights[order]) - 0.5 * weights[order]
    center = float(np.interp(0.5 * weights.sum(), below, values[order]))
    scatter = MAD_TO_STD * float(np.median(np.abs(values - center)))
    return center, max(scatter, float(np.median(errors)))


def median_angle(estimates: Sequence[Measured]) -> Measured:
    """Computes ``median`` of angles in deg, wrapped around their mean direction."""
    known = [row for row in estimates if row[0] is not None]
    mean = sum(cmath.exp(1j * math.radians(angle or 0.0)) for angle, _ in known)
    center = math.degrees(cmath.phase(mean))
    offset, scatter = median(
        [(wrapped_deg((angle or 0.0) - center), error) for angle, error in known]
    )
    return None if offset is None else wrapped_deg(center + offset), scatter


def usual(values: Sequence[float | None]) -> float | None:
    """Returns the plain median of the known values, or None if there are none."""
    known = [value for value in values if value is not None]
    return float(np.median(known)) if known else None


def wrapped_deg(angle: float) -> float:
    """Returns an angle wrapped to (-180, 180], deg."""
    return 180.0 - (180.0 - angle) % 360.0
