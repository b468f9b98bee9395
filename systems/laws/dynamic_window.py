"""The dynamic window approach: gains, equation, and record."""

from __future__ import annotations

from systems.framework.parameters import (
    Length,
    NonNegative,
    NonNegativeLength,
    Parameters,
    Positive,
)
from systems.laws.law import Equation, Law


class DynamicWindowParameters(Parameters):
    """Weights and limits of the dynamic window."""

    clearance_m: NonNegativeLength = 0.19
    """Distance that the robot keeps from cells with echoes, m."""
    heading_gain: NonNegative = 0.91
    """Weight alpha of the heading (paper: 2)."""
    distance_gain: NonNegative = 3.0
    """Weight beta of the distance to the nearest obstacle on the arc (paper: 0.2)."""
    speed_gain: NonNegative = 3.6
    """Weight gamma of the speed (paper: 0.2)."""
    turn_acceleration_rad_s2: Positive = 6.1
    """Yaw acceleration that limits the window, and that stops a turn, rad/s^2."""
    farthest_m: Length = 2.6
    """Largest distance along the arc that counts, m. An obstacle that is farther away
    counts as if it were at this distance."""


DWA = Law(
    name="dwa",
    title="Dynamic window approach (Fox, Burgard and Thrun 1997)",
    label="dynamic window",
    equations=(
        Equation(
            "Dynamic window approach: objective",
            r"G(v,\omega)=\alpha\,\mathrm{heading}+\beta\,\mathrm{dist}"
            r"+\gamma\,\mathrm{velocity}",
            "G(v, w) = alpha heading + beta dist + gamma velocity",
        ),
    ),
    controller_name="DynamicWindowController",
    gains=DynamicWindowParameters,
)
