"""The dynamic window approach: gains, equation, and record."""

from __future__ import annotations

from systems.framework.parameters import (
    NonNegative,
    NonNegativeLength,
    Parameters,
)
from systems.laws.law import Equation, Law


class DynamicWindowParameters(Parameters):
    """Weights and limits of the dynamic window."""

    clearance_m: NonNegativeLength = 0.05
    """Distance that the robot keeps from the middles of cells with echoes, m (one cell
    of the map)."""
    heading_gain: NonNegative = 2.0
    """Weight alpha of the heading (as in the paper)."""
    distance_gain: NonNegative = 0.2
    """Weight beta of the distance to the nearest obstacle on the arc (as in the
    paper)."""
    speed_gain: NonNegative = 0.2
    """Weight gamma of the speed (as in the paper)."""


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
