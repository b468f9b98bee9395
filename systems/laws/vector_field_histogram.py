"""The vector field histogram VFH+: gains, equation, and record."""

from __future__ import annotations

from systems.framework.parameters import (
    Length,
    NonNegative,
    NonNegativeLength,
    Parameters,
    Positive,
)
from systems.laws.law import Equation, Law


class VectorFieldHistogramParameters(Parameters):
    """Weights and thresholds of VFH+."""

    clearance_m: NonNegativeLength = 0.04
    """Distance that the robot keeps from cells with echoes, m."""
    window_m: Length | None = None
    """Distance within which occupied cells count, m. The paper uses 1.65 m, half of the
    side of its active window. With null, the distance is 2.5 times the radius of the
    disc that contains the body."""
    low_threshold: NonNegative = 0.33
    """Density of obstacles below which a sector becomes free. If the density is above
    twice this value, the sector becomes blocked. Between both thresholds, the sector
    keeps its state."""
    slow_density: Positive = 69.0
    """Density in the chosen direction at which the speed falls to 0."""
    previous_gain: NonNegative = 2.9
    """Weight mu_3 of the previously chosen direction (paper: 2)."""


VFH_PLUS = Law(
    name="vfh_plus",
    title="VFH+ (Ulrich and Borenstein 1998)",
    label="VFH+",
    equations=(
        Equation(
            "VFH+: cost of a candidate direction",
            r"g(c)=\mu_1\,\Delta(c,k_t)+\mu_2\,\Delta(c,\theta/\alpha)"
            r"+\mu_3\,\Delta(c,k_{n-1})",
            "g(c) = mu_1 D(c, k_t) + mu_2 D(c, theta/alpha) + mu_3 D(c, k_(n-1))",
        ),
    ),
    controller_name="VectorFieldHistogramController",
    gains=VectorFieldHistogramParameters,
)
