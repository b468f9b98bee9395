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

__all__ = [
    "PlumeSearchParameters",
    "SongRuleParameters",
    "SoundSearchParameters",
    "UpwindGradientParameters",
]


class SongRuleParameters(Parameters):
    """Thresholds and angles of the four phases (Song 2011, 4.2)."""

    initial_threshold: float = Field(default=0.95, ge=0.0, le=2.0)
    """R_init: in the plume where all three ratios Rs/R0 are below."""
    airflow_threshold: Positive = 1.0
    """F_thresh, in the unit of ``airflow``: printed without one, so that
    ``airflow_sensors.gain_s_m`` decides what it means."""
    turning_threshold: float = Field(default=0.75, ge=0.0, le=2.0)
    """R_turning: phase 3 turns where R1 or R3 is below."""
    reverse_threshold: float = Field(default=0.9, ge=0.0, le=2.0)
    """R_reverse: phase 3 turns back where R2 is least and below. Used in the paper
    without a value; ours."""
    upwind_turn_deg: float = Field(default=45.0, ge=0.0, le=180.0)
    """Of phase 2, deg."""
    gradient_turn_deg: float = Field(default=60.0, ge=0.0, le=180.0)
    """Of phase 3, deg."""
    local_turn_deg: float = Field(default=30.0, ge=0.0, le=180.0)
    """Of phase 4, deg."""


class UpwindGradientParameters(Parameters):
    """Upwind, with the gradient of the smell across; all ours."""

    gain_deg: Angle = 20.0
    """Lean towards the front sensor that smells more, deg for each e-fold between their
    ratios Rs/R0."""
    largest_lean_deg: float = Field(default=45.0, ge=0.0, le=90.0)
    """Largest lean, deg."""
    lost_share: Fraction = 0.35
    """Lost: no sensor's 1 - Rs/R0 is this share of the largest one so far."""
    cast_deg: float = Field(default=110.0, ge=45.0, le=180.0)
    """Lost, it goes to either side in turn at this angle from upwind, a step farther
    each time, deg."""
    still_air: Positive = 0.05
    """No wind: both airflow sensors read less than this, in their own unit."""


class PlumeSearchParameters(Parameters):
    """Times of a step, and the rules by which it turns."""

    rules: Literal["song2011", "upwind_gradient"] = "upwind_gradient"
    """The paper's four phases, or ours."""
    wait_s: Time = 15.0
    """Rest before the sensors count, s (Song 2011, 4.2)."""
    sense_s: Duration = 2.0
    """Their mean over this time counts, without the largest and the least reading, s
    (4.2)."""
    move_s: Duration = 3.0
    """Turning and driving, s (4.2)."""
    most_steps: int = Field(default=40, ge=1, le=1_000)
    """After so many steps the search is given up."""
    gate: bool = True
    """Whether what is touched has to smell to be the source; off: any touch ends the
    search as a find, as printed."""
    gate_share: Fraction = 0.95
    """It smells where the least of the three ratios since the last stop but one, those
    of the stops included, is below this share of that in clean air, 1."""
    address: int = Field(default=1, ge=1, le=3)
    """Of the robot in its radio frames (Song 2011, 3.3)."""
    call_every_s: Duration = 1.0
    """Once it has ended it reports so by radio every so often, s."""
    song2011: SongRuleParameters = SongRuleParameters()
    """Of the paper's rules."""
    upwind_gradient: UpwindGradientParameters = UpwindGradientParameters()
    """Of ours."""


class SoundSearchParameters(Parameters):
    """Times of a step, who calls, who waits, and where the robot stops."""

    await_call: bool = True
    """Whether it starts when the caller reports its find by radio; off: at once."""
    caller: int = Field(default=1, ge=1, le=3)
    """Address of the robot that calls (Song 2011, 3.3)."""
    address: int = Field(default=2, ge=1, le=3)
    """Of this robot in its radio frames."""
    waits_for: int = Field(default=0, ge=0, le=3)
    """Address of a robot that goes first: this one holds within ``hold_within_m`` of
    the caller until that one reports its result; 0: none."""
    hold_within_m: Length = 1.2
    """By radio, m."""
    hold_s: Duration = 200.0
    """It holds for so long at most, s."""
    call_within_s: Duration = 1800.0
    """Without a call for so long it gives up, s."""
    noise_s: Time = 0.5
    """At the start it listens to the noise alone, s; 0: it does not."""
    listen_s: Duration = 2.0
    """Of a step, s (Song 2011, 4.3)."""
    compute_s: Duration = 5.0
    """Of a step, s (4.3)."""
    move_s: Duration = 3.0
    """Of a step, turning and driving, s (4.3)."""
    stop: Literal["range", "radio"] = "range"
    """It has arrived by the range that it hears, or by radio; or by radio alone, as
    printed."""
    stop_range_m: Length = 0.52
    """Nearer than this to what it hears it has arrived, m."""
    radio_gate_m: Length = 1.2
    """Only this near by radio does the range that it hears count, m."""
    radio_stop_m: Length = 0.42
    """Nearer than this by radio, meant over a step's listening, it has arrived, m;
    printed: 0.2 (4.3), where the robots' arms have long touched."""
    tries: int = Field(default=3, ge=1, le=100)
    """So many times in a row it may hear nothing, or not whence, before it gives up."""
    most_steps: int = Field(default=30, ge=1, le=1_000)
    """After so many steps the search is given up."""
    report_every_s: Duration = 1.0
    """Once it has ended it reports so by radio every so often, s."""
