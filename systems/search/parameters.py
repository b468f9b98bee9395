"""Parameters of the searches by smell and by sound."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from systems.framework.parameters import Duration, Length, Parameters, Time

#: Radio address of the robot that calls (Song 2011, 3.3).
CALLER = 1


class PlumeSearchParameters(Parameters):
    """Rules of the turns, and end of the search by smell."""

    rules: Literal["song2011", "upwind_gradient"] = "upwind_gradient"
    """``song2011``: the four phases of the paper. ``upwind_gradient``: our rules."""
    wait_s: Time = 15.0
    """Time at rest before the robot uses the readings, s (Song 2011, 4.2)."""
    most_steps: int = Field(default=40, ge=1, le=1_000)
    """Number of steps after which the robot gives up the search."""
    gate: bool = True
    """Whether a touched object must smell to count as the source. Off: any touched
    object counts as the source, as the paper prints."""
    address: int = Field(default=CALLER, ge=1, le=3)
    """Address of the robot in its radio frames (Song 2011, 3.3)."""


class SoundSearchParameters(Parameters):
    """Radio addresses, and end of the search by sound."""

    await_call: bool = True
    """Whether the robot waits for a call before it starts. The robot with the radio
    address 1 calls when it has found the odor source. Off: the robot starts at
    once."""
    address: int = Field(default=2, ge=1, le=3)
    """Address of this robot in its radio frames."""
    waits_for: int = Field(default=0, ge=0, le=3)
    """Radio address of another robot that goes first. Within 1.2 m of the caller, this
    robot waits until the other robot reports its result. 0: no robot goes first."""
    noise_s: Time = 0.5
    """Time at the start in which the robot listens only to the noise, s. 0: none."""
    listen_s: Duration = 2.0
    """Listening time of a step, s (Song 2011, 4.3)."""
    stop: Literal["range", "radio"] = "range"
    """Criterion for the arrival. ``range``: the heard range or the radio level.
    ``radio``: only the radio level, as the paper prints."""
    stop_range_m: Length = 0.52
    """Heard range below which the robot has arrived, m."""
    radio_stop_m: Length = 0.42
    """Distance from the caller below which the robot has arrived, m. The robot computes
    the distance from the mean radio level over the listening time of a step. The paper
    prints 0.2 (4.3), but at this distance the arms of the robots already touch."""
    most_steps: int = Field(default=30, ge=1, le=1_000)
    """Number of steps after which the robot gives up the search."""
