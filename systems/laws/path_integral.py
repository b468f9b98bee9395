"""Model predictive path integral control (MPPI): gains, equation, and record."""

from __future__ import annotations

from pydantic import Field

from systems.framework.parameters import (
    Duration,
    Length,
    NonNegative,
    NonNegativeLength,
    Positive,
    Speed,
)
from systems.laws.law import Equation, Law
from systems.laws.parameters import MapParameters


class PathIntegralParameters(MapParameters):
    """Samples and costs of the controller. The cost terms are those of Nav2.

    All costs except that of ``control_gain`` are means over the steps of a sequence.
    """

    clearance_m: NonNegativeLength = 0.08
    """Distance that the robot keeps from cells with echoes, m."""
    samples: int = Field(default=500, ge=10, le=5_000)
    """Number of motion sequences that each plan tries."""
    steps: int = Field(default=25, ge=2, le=100)
    """Number of steps of a sequence."""
    step_s: Duration = 0.1
    """Length of a step, and time from one plan to the next, s."""
    speed_spread_m_s: Speed = 0.2
    """Standard deviation of the sampled speeds, m/s (Nav2: 0.2)."""
    turn_spread_rad_s: Positive = 1.1
    """Standard deviation of the sampled yaw rates, rad/s."""
    temperature: Positive = 0.37
    """Increase of the cost that divides the weight of a sequence by e (Nav2: 0.3)."""
    control_gain: NonNegative = 0.015
    """Cost gamma of a deviation from the last plan (Nav2: 0.015)."""
    goal_gain: NonNegative = 5.0
    """Cost per meter of distance from the wanted position (Nav2's goal critic: 5)."""
    angle_gain: NonNegative = 0.63
    """Cost per radian between the heading and the direction of the wanted position
    (Nav2's path angle critic: 2)."""
    forward_gain: NonNegative = 0.81
    """Cost of driving backward, s/m (Nav2's prefer forward critic: 5)."""
    obstacle_gain: NonNegative = 3.4
    """Cost of a position at the distance ``clearance_m`` from an obstacle (Nav2's cost
    critic: 3.81)."""
    inflation_m: Length = 0.057
    """Distance over which the cost of ``obstacle_gain`` falls to 1/e, m."""
    collision_cost: NonNegative = 1_000.0
    """Cost of a position nearer to an obstacle than the clearance."""


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
