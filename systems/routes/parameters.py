"""Parameters of routes and of the targets on them."""

from __future__ import annotations

from typing import Literal

from pydantic import model_validator

from systems.framework.input_error import InputError
from systems.framework.parameters import (
    Acceleration,
    Duration,
    Length,
    Parameters,
    Point,
    Speed,
)

__all__ = [
    "PathTargetParameters",
    "RouteParameters",
    "check_cells",
]

#: Cells in the radius of the disc at least: then a step between two free cells comes
#: nearer than the radius by less than 3 % of it.
_LEAST_CELLS = 3.0


def check_cells(cell_m: float, radius_m: float) -> None:
    """Refuses cells that are too coarse for what obstacles are grown by.

    Args:
        cell_m: Side of a cell, m.
        radius_m: Obstacles are to be grown by it, m.

    Raises:
        InputError: They are.
    """
    if cell_m * _LEAST_CELLS > radius_m:
        raise InputError(
            "cell_m",
            f"{cell_m:g} m is too coarse for a clearance of {radius_m:g} m; lower it "
            f"to {radius_m / _LEAST_CELLS:.3g} or less",
        )


class PathTargetParameters(Parameters):
    """How the target moves along the route."""

    speed_m_s: Speed = 0.15
    """Its speed along the route, m/s (ours; Engelbrecht and others print none)."""
    acceleration_m_s2: Acceleration = 0.15
    """Of that speed from rest and to rest, m/s^2 (ours)."""
    timing: Literal["timed", "waiting"] = "timed"
    """It moves by the clock, as in the paper, or waits for the robot."""
    lead_m: Length = 0.5
    """Where it waits, it is no farther ahead of P along the route, m (ours)."""


class RouteParameters(PathTargetParameters):
    """Where the robot goes, how its route is planned, and how the target moves."""

    goal_m: Point = (4.0, 0.0)
    """Where P is to go in W, m."""
    clearance_m: Length = 0.35
    """Kept between the route and all obstacles, m (ours)."""
    cell_m: Length = 0.05
    """Side of a cell of the grid, m (ours)."""
    arena_margin_m: Length = 2.0
    """Routes stay in the least rectangle about start, goal and known obstacles, and
    this margin, m (ours)."""
    replan: bool = True
    """Whether a robot that stalls plans anew, with what it has seen (ours)."""
    stall_m: Length = 0.1
    """It stalls where P does not come so far along the route, m ..."""
    stalled_s: Duration = 6.0
    """... in this time, s."""
    arrived_m: Length = 0.15
    """Nearer to the goal than this it has arrived, and does not stall, m."""

    @model_validator(mode="after")
    def _check(self) -> RouteParameters:
        if self.stall_m > self.speed_m_s * self.stalled_s:
            raise InputError(
                "stall_m",
                f"{self.stall_m:g} m in stalled_s = {self.stalled_s:g} s is more than "
                f"speed_m_s = {self.speed_m_s:g} makes: it would always stall; lower "
                "it, or raise stalled_s",
            )
        check_cells(self.cell_m, self.clearance_m)
        return self
