"""Model predictive path integral control (MPPI): gains, equation, and record."""

from __future__ import annotations

from systems.framework.parameters import (
    Length,
    NonNegative,
    NonNegativeLength,
    Parameters,
    Positive,
)
from systems.laws.law import Equation, Law


class PathIntegralParameters(Parameters):
    """Gains of MPPI: spread of the sampled motions, and weights of the cost terms.

    MPPI is model predictive path integral control. The cost terms are those of the MPPI
    controller in Nav2.
    """

    clearance_m: NonNegativeLength = 0.05
    """Distance that the robot keeps from cells with echoes, m (one cell of the map)."""
    turn_spread_rad_s: Positive = 1.1
    """Standard deviation of the sampled yaw rates, rad/s."""
    temperature: Positive = 0.37
    """Temperature of the weights of sequences, exp(-cost/temperature) (Nav2: 0.3)."""
    angle_gain: NonNegative = 0.63
    """Cost per radian of the angle between the heading and the direction of the wanted
    position (Nav2's path angle critic: 2).
    """
    obstacle_gain: NonNegative = 3.4
    """Cost of a position at the distance ``clearance_m`` from an obstacle (Nav2's cost
    critic: 3.81).
    """
    inflation_m: Length = 0.057
    """Distance over which the cost of ``obstacle_gain`` falls to 1/e, m."""


MPPI = Law(
    name="mppi",
    title="Model predictive path integral control (Williams et al. 2018)",
    label="MPPI",
    equations=(
        Equation(
            "MPPI: the plan",
            r"u_k=\sum_n w_n\,(u_k+\epsilon_k^n),"
            r"\quad w_n\propto\exp(-\frac{1}{\lambda}S_n)",
            "u_k = sum of w_n (u_k + e_k^n), w_n ~ exp(-S_n/lambda)",
        ),
    ),
    controller_name="PathIntegralController",
    gains=PathIntegralParameters,
)
