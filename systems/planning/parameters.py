"""Parameters of the safety filter."""

from __future__ import annotations

from pydantic import Field

from systems.framework.parameters import (
    NonNegativeLength,
    Parameters,
)


class SafetyFilterParameters(Parameters):
    """Distances that the filter keeps; all values are our choice."""

    margin_m: NonNegativeLength = 0.05
    """Distance kept between objects and the disc about the axle that contains the body,
    m."""
    approach_rate: float = Field(default=1.0, ge=1e-3, le=100.0)
    """alpha, 1/s. P may approach an obstacle at rest at most at alpha times the
    remaining distance."""
    horizon_s: float = Field(default=4.0, ge=0.1, le=60.0)
    """Duration of the prediction, s. Later contacts with moving objects do not
    count."""
