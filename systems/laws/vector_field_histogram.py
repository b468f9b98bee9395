"""VFH+: gains, equation and record."""

from __future__ import annotations

from pydantic import model_validator

from systems.framework.input_error import InputError
from systems.framework.parameters import (
    Length,
    NonNegative,
    NonNegativeLength,
    Positive,
)
from systems.laws.law import Equation, Law
from systems.laws.parameters import MapParameters


class VectorFieldHistogramParameters(MapParameters):
    """Weights and thresholds of VFH+."""

    clearance_m: NonNegativeLength = 0.04
    """Distance kept from places of echoes, m."""
    window_m: Length = 1.1
    """Cells within this distance count, m; half of the paper's active window is
    1.65."""
    low_threshold: NonNegative = 0.33
    """A sector with a lower density is free."""
    high_threshold: NonNegative = 0.66
    """A sector with a higher density is blocked; in between it keeps its state."""
    slow_density: Positive = 69.0
    """Density ahead at which the robot would stop."""
    target_gain: NonNegative = 5.0
    """Weight mu_1 of the target's direction (the paper's)."""
    heading_gain: NonNegative = 2.0
    """Weight mu_2 of the robot's heading (the paper's)."""
    previous_gain: NonNegative = 2.9
    """Weight mu_3 of the direction chosen before (the paper's: 2)."""

    @model_validator(mode="after")
    def _check_thresholds(self) -> VectorFieldHistogramParameters:
        if self.high_threshold < self.low_threshold:
            raise InputError(
                "high_threshold",
                f"{self.high_threshold:g} is below low_threshold, "
                f"{self.low_threshold:g}; raise it",
            )
        return self


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
    plans=True,
)
