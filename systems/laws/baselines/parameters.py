"""Parameters of the baselines."""

from __future__ import annotations

from pydantic import Field, model_validator

from systems.framework.input_error import InputError
from systems.framework.parameters import (
    Acceleration,
    Duration,
    Length,
    NonNegative,
    NonNegativeLength,
    Parameters,
    Positive,
    Speed,
)


class StopWhenNearParameters(Parameters):
    """When it stops."""

    stop_m: Length = 0.6
    """The robot stops while an echo is nearer than this, m."""


class MapParameters(Parameters):
    """Of baselines that look at a map of echoes."""

    clearance_m: NonNegativeLength = 0.05
    """Distance kept from places of echoes, m."""
    source_clearance_m: NonNegativeLength = 0.5
    """Echoes within this distance of the target count as echoes of the target, m."""


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


class PathIntegralParameters(MapParameters):
    """Samples and costs of the controller; the critics are those of Nav2."""

    clearance_m: NonNegativeLength = 0.08
    """Distance kept from places of echoes, m."""
    samples: int = Field(default=500, ge=10, le=5_000)
    """Sequences of motions that are tried."""
    steps: int = Field(default=25, ge=2, le=100)
    """Steps of a sequence."""
    step_s: Duration = 0.1
    """Length of a step, and time from one plan to the next, s."""
    speed_spread_m_s: Speed = 0.2
    """Standard deviation of tried speeds, m/s (Nav2's)."""
    turn_spread_rad_s: Positive = 1.1
    """Standard deviation of tried yaw rates, rad/s."""
    temperature: Positive = 0.37
    """A sequence whose cost is higher by this has a weight of 1/e; Nav2 has 0.3."""
    control_gain: NonNegative = 0.015
    """Cost of a deviation from the last plan, gamma (value of Nav2)."""
    goal_gain: NonNegative = 5.0
    """Cost per meter of mean distance from the wanted position (Nav2's goal critic:
    5)."""
    angle_gain: NonNegative = 0.63
    """Cost per radian off the direction of the path (Nav2's path angle critic: 2)."""
    forward_gain: NonNegative = 0.81
    """Cost of driving backward, s/m (Nav2's prefer forward critic: 5)."""
    obstacle_gain: NonNegative = 3.4
    """Cost of touching the clearance of obstacles (Nav2's cost critic: 3.81)."""
    inflation_m: Length = 0.057
    """Distance over which this cost falls to 1/e, m."""
    collision_cost: NonNegative = 1_000.0
    """Cost of a contact."""


class ReciprocalAvoidanceParameters(Parameters):
    """Horizon and disc of ORCA."""

    horizon_s: Duration = 1.8
    """Time for which the law avoids contacts, s."""
    offset_m: Length = 0.045
    """Distance of the holonomic point ahead of the axle, m."""
    clearance_m: NonNegativeLength = 0.02
    """Distance kept from all bodies, m."""
    farthest_m: Length = 5.0
    """Bodies farther away than this do not count, m."""
