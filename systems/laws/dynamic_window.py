"""The dynamic window approach: gains, equation and record."""

from __future__ import annotations

from systems.framework.parameters import (
    Acceleration,
    Duration,
    Length,
    NonNegative,
    NonNegativeLength,
    Positive,
)
from systems.laws.law import Equation, Law
from systems.laws.parameters import MapParameters


class DynamicWindowParameters(MapParameters):
    """Weights and limits of the dynamic window."""

    clearance_m: NonNegativeLength = 0.19
    """Distance kept from places of echoes, m."""
    heading_gain: NonNegative = 0.91
    """Weight alpha of the heading (the paper's: 2)."""
    distance_gain: NonNegative = 3.0
    """Weight beta of the distance to the next obstacle (the paper's: 0.2)."""
    speed_gain: NonNegative = 3.6
    """Weight gamma of the speed (the paper's: 0.2)."""
    acceleration_m_s2: Acceleration = 1.0
    """Acceleration of the window and of braking, m/s^2."""
    turn_acceleration_rad_s2: Positive = 6.1
    """Turning acceleration of the window and of braking, rad/s^2."""
    period_s: Duration = 0.1
    """Time from one choice to the next, s."""
    farthest_m: Length = 2.6
    """Obstacles farther along an arc count as being at this distance, m."""


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
    plans=True,
)
