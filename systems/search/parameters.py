"""Parameters of searches."""

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
    """R_init: the robot is in the plume where all three ratios Rs/R0 are below this."""
    airflow_threshold: Positive = 1.0
    """F_thresh, in the unit of ``airflow``: printed without a unit, so that
    ``airflow_sensors.gain_s_m`` defines its meaning."""
    turning_threshold: float = Field(default=0.75, ge=0.0, le=2.0)
    """R_turning: phase 3 turns where R1 or R3 is below this."""
    reverse_threshold: float = Field(default=0.9, ge=0.0, le=2.0)
    """R_reverse: phase 3 turns back where R2 is the least ratio and below this. The
    paper uses it without a value; our choice."""
    upwind_turn_deg: float = Field(default=45.0, ge=0.0, le=180.0)
    """Turn of phase 2, deg."""
    gradient_turn_deg: float = Field(default=60.0, ge=0.0, le=180.0)
    """Turn of phase 3, deg."""
    local_turn_deg: float = Field(default=30.0, ge=0.0, le=180.0)
    """Turn of phase 4, deg."""


class UpwindGradientParameters(Parameters):
    """Upwind, corrected by the gradient of the smell across; our rules."""

    gain_deg: Angle = 20.0
    """Lean toward the front sensor that smells more, deg per e-fold between their
    ratios Rs/R0."""
    largest_lean_deg: float = Field(default=45.0, ge=0.0, le=90.0)
    """Largest lean, deg."""
    lost_share: Fraction = 0.35
    """The plume is lost if no sensor's 1 - Rs/R0 is this share of the largest value so
    far."""
    cast_deg: float = Field(default=110.0, ge=45.0, le=180.0)
    """Angle from upwind at which it casts to either side in turn after it lost the
    plume, one step farther each time, deg."""
    still_air: Positive = 0.05
    """There is no wind if both airflow sensors read less than this, in their unit."""


class PlumeSearchParameters(Parameters):
    """Times of a step, and the rules by which it turns."""

    rules: Literal["song2011", "upwind_gradient"] = "upwind_gradient"
    """The paper's four phases, or our rules."""
    wait_s: Time = 15.0
    """Rest before the sensors count, s (Song 2011, 4.2)."""
    sense_s: Duration = 2.0
    """Time over which readings are averaged, without the largest and the least reading,
    s (4.2)."""
    move_s: Duration = 3.0
    """Time for turning and driving, s (4.2)."""
    most_steps: int = Field(default=40, ge=1, le=1_000)
    """Number of steps after which the robot gives up the search."""
    gate: bool = True
    """Whether an object that the robot touches must smell to count as the source; off:
    any touch ends the search as a find, as printed."""
    gate_share: Fraction = 0.95
    """An object smells if the least of the three ratios since the stop before the last
    one, both stops included, is below this share of the ratio in clean air, 1."""
    address: int = Field(default=1, ge=1, le=3)
    """Address of the robot in its radio frames (Song 2011, 3.3)."""
    call_every_s: Duration = 1.0
    """Period of its radio reports after the search has ended, s."""
    song2011: SongRuleParameters = SongRuleParameters()
    """Gains of the paper's rules."""
    upwind_gradient: UpwindGradientParameters = UpwindGradientParameters()
    """Gains of our rules."""


class SoundSearchParameters(Parameters):
    """Times of a step, who calls, who waits, and where the robot stops."""

    await_call: bool = True
    """Whether it starts when the caller reports its find by radio; off: it starts at
    once."""
    caller: int = Field(default=1, ge=1, le=3)
    """Address of the robot that calls (Song 2011, 3.3)."""
    address: int = Field(default=2, ge=1, le=3)
    """Address of this robot in its radio frames."""
    waits_for: int = Field(default=0, ge=0, le=3)
    """Address of a robot that goes first: this robot holds within ``hold_within_m`` of
    the caller until the other robot reports its result; 0: none."""
    hold_within_m: Length = 1.2
    """Distance by radio at which it holds, m."""
    hold_s: Duration = 200.0
    """Longest time for which it holds, s."""
    call_within_s: Duration = 1800.0
    """Time without a call after which it gives up, s."""
    noise_s: Time = 0.5
    """Time at the start for which it listens to the noise only, s; 0: it does not."""
    listen_s: Duration = 2.0
    """Listening time of a step, s (Song 2011, 4.3)."""
    compute_s: Duration = 5.0
    """Computing time of a step, s (4.3)."""
    move_s: Duration = 3.0
    """Time of a step for turning and driving, s (4.3)."""
    stop: Literal["range", "radio"] = "range"
    """Whether the heard range or the radio decides on its arrival; or the radio only,
    as printed."""
    stop_range_m: Length = 0.52
    """Heard range below which it has arrived, m."""
    radio_gate_m: Length = 1.2
    """The heard range counts only within this distance by radio, m."""
    radio_stop_m: Length = 0.42
    """Distance by radio, averaged over the listening time of a step, below which it has
    arrived, m; printed: 0.2 (4.3), at which the robots' arms already touch."""
    tries: int = Field(default=3, ge=1, le=100)
    """Number of times in a row that it may hear nothing, or no direction, before it
    gives up."""
    most_steps: int = Field(default=30, ge=1, le=1_000)
    """Number of steps after which the robot gives up the search."""
    report_every_s: Duration = 1.0
    """Period of its radio reports after the search has ended, s."""
