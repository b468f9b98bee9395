"""Parameters of the searches by smell and by sound."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from systems.framework.parameters import (
    Angle,
    Duration,
    Fraction,
    Length,
    Parameters,
    Positive,
    Time,
)


class SongRuleParameters(Parameters):
    """Thresholds and angles of the four phases (Song 2011, 4.2)."""

    initial_threshold: float = Field(default=0.95, ge=0.0, le=2.0)
    """R_init. The robot is in the plume if all three ratios Rs/R0 are below this."""
    airflow_threshold: Positive = 1.0
    """F_thresh, in the unit of the port ``airflow``. The paper prints no unit, so that
    ``airflow_sensors.gain_s_m`` defines the meaning of this value."""
    turning_threshold: float = Field(default=0.75, ge=0.0, le=2.0)
    """R_turning. In phase 3, the robot turns if R1 or R3 is below this."""
    reverse_threshold: float = Field(default=0.9, ge=0.0, le=2.0)
    """R_reverse. In phase 3, the robot turns back if R2 is the smallest ratio and below
    this. The paper prints no value. The default is our choice."""
    upwind_turn_deg: float = Field(default=45.0, ge=0.0, le=180.0)
    """Turning angle in phase 2, deg."""
    gradient_turn_deg: float = Field(default=60.0, ge=0.0, le=180.0)
    """Turning angle in phase 3, deg."""
    local_turn_deg: float = Field(default=30.0, ge=0.0, le=180.0)
    """Turning angle in phase 4, deg."""


class UpwindGradientParameters(Parameters):
    """Our rules: go upwind, and turn toward the side with more gas."""

    gain_deg: Angle = 20.0
    """Gain of the angle from upwind toward the front sensor with more gas, deg. The
    angle is this gain times the natural logarithm of the quotient of the two front
    ratios Rs/R0."""
    largest_lean_deg: float = Field(default=45.0, ge=0.0, le=90.0)
    """Largest angle from upwind toward the side with more gas, deg."""
    lost_share: Fraction = 0.35
    """The robot has lost the plume if 1 - Rs/R0 of all sensors is below this share of
    the largest value so far."""
    cast_deg: float = Field(default=110.0, ge=45.0, le=180.0)
    """Angle from upwind at which the robot searches for a lost plume, deg. The robot
    goes to the two sides alternately, and each time one step farther."""
    still_air: Positive = 0.05
    """There is no wind if both airflow sensors read less than this, in their unit."""


class PlumeSearchParameters(Parameters):
    """Durations of a step, rules of the turns, and end of the search by smell."""

    rules: Literal["song2011", "upwind_gradient"] = "upwind_gradient"
    """``song2011``: the four phases of the paper. ``upwind_gradient``: our rules."""
    wait_s: Time = 15.0
    """Time at rest before the robot uses the readings, s (Song 2011, 4.2)."""
    sense_s: Duration = 2.0
    """Averaging time of the readings, s (4.2). The mean excludes the largest and the
    smallest reading."""
    move_s: Duration = 3.0
    """Time for turning and driving in a step, s (4.2)."""
    most_steps: int = Field(default=40, ge=1, le=1_000)
    """Number of steps after which the robot gives up the search."""
    gate: bool = True
    """Whether a touched object must smell to count as the source. Off: any touched
    object counts as the source, as the paper prints."""
    gate_share: Fraction = 0.95
    """An object smells if the lowest gas ratio is below this. Clean air has the ratio
    1. This lowest ratio is the minimum of the mean ratios of the last two stops and of
    all readings since the last stop."""
    address: int = Field(default=1, ge=1, le=3)
    """Address of the robot in its radio frames (Song 2011, 3.3)."""
    call_every_s: Duration = 1.0
    """Period of the radio reports after the end of the search, s."""
    song2011: SongRuleParameters = SongRuleParameters()
    """Parameters of the rules of the paper."""
    upwind_gradient: UpwindGradientParameters = UpwindGradientParameters()
    """Parameters of our rules."""


class SoundSearchParameters(Parameters):
    """Durations of a step, radio addresses, and end of the search by sound."""

    await_call: bool = True
    """Whether the robot starts only after the caller has reported by radio that it has
    found the odor source. Off: the robot starts at once."""
    caller: int = Field(default=1, ge=1, le=3)
    """Radio address of the robot that calls (Song 2011, 3.3)."""
    address: int = Field(default=2, ge=1, le=3)
    """Address of this robot in its radio frames."""
    waits_for: int = Field(default=0, ge=0, le=3)
    """Radio address of a robot that goes first. If this robot is within
    ``hold_within_m`` of the caller, it waits until the other robot reports its result.
    0: no robot goes first."""
    hold_within_m: Length = 1.2
    """Distance from the caller within which the robot waits, m. The robot computes the
    distance from the radio level."""
    hold_s: Duration = 200.0
    """Longest time for which the robot waits for the other robot, s."""
    call_within_s: Duration = 1800.0
    """Time without a call after which the robot gives up, s."""
    noise_s: Time = 0.5
    """Time at the start in which the robot listens only to the noise, s. 0: none."""
    listen_s: Duration = 2.0
    """Listening time of a step, s (Song 2011, 4.3)."""
    compute_s: Duration = 5.0
    """Computing time of a step, s (4.3)."""
    move_s: Duration = 3.0
    """Time of a step for turning and driving, s (4.3)."""
    stop: Literal["range", "radio"] = "range"
    """Criterion for the arrival. ``range``: the heard range or the radio level.
    ``radio``: only the radio level, as the paper prints."""
    stop_range_m: Length = 0.52
    """Heard range below which the robot has arrived, m."""
    radio_gate_m: Length = 1.2
    """Distance from the caller below which the heard range counts, m. The robot
    computes the distance from the radio level."""
    radio_stop_m: Length = 0.42
    """Distance from the caller below which the robot has arrived, m. The robot computes
    the distance from the mean radio level over the listening time of a step. The paper
    prints 0.2 (4.3), but at this distance the arms of the robots already touch."""
    tries: int = Field(default=3, ge=1, le=100)
    """Number of consecutive steps without a unique direction of the sound after which
    the robot gives up."""
    most_steps: int = Field(default=30, ge=1, le=1_000)
    """Number of steps after which the robot gives up the search."""
    report_every_s: Duration = 1.0
    """Period of the radio reports after the end of the search, s."""
