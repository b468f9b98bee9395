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

#: Least ratio of the disc's radius to the side of a cell. With this ratio, the distance
#: of a step between two free cells from an obstacle is at least 97 % of the radius.
_LEAST_CELLS = 3.0


def check_cells(cell_m: float, radius_m: float) -> None:
    """Checks that cells are fine enough for the enlargement of obstacles.

    Args:
        cell_m: Side of a cell, m.
        radius_m: Radius by which obstacles are enlarged, m.

    Raises:
        InputError: The cells are too coarse.
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
    """Speed of the target along the route, m/s (our choice; Engelbrecht and others give
    no value)."""
    acceleration_m_s2: Acceleration = 0.15
    """Acceleration from rest and to rest, m/s^2 (our choice)."""
    timing: Literal["timed", "waiting"] = "timed"
    """Whether the target moves by the clock, as in the paper, or waits for the
    robot."""
    lead_m: Length = 0.5
    """Greatest lead of a waiting target over P along the route, m (our choice)."""


class RouteParameters(PathTargetParameters):
    """Where the robot goes, how its route is planned, and how the target moves."""

    goal_m: Point = (4.0, 0.0)
    """Goal of P in W, m."""
    clearance_m: Length = 0.35
    """Planned distance between the route and known obstacles, m (our choice). After
    rounding, the route keeps at least 92 % of this distance."""
    cell_m: Length = 0.05
    """Side of a cell of the grid, m (our choice)."""
    arena_margin_m: Length = 2.0
    """Margin around the smallest rectangle that contains start, goal and known
    obstacles, m (our choice). Routes stay within this area."""
    replan: bool = True
    """Whether a robot that stalls plans a new route around the obstacles that it has
    seen (our choice)."""
    stall_m: Length = 0.1
    """The robot stalls if P advances by less than this along the route within
    ``stalled_s``, m."""
    stalled_s: Duration = 6.0
    """Time, s, in which P has to advance by ``stall_m``. Otherwise the robot stalls."""
    arrived_m: Length = 0.15
    """Distance from the goal, m. Within this distance, the robot has arrived and does
    not stall."""

    @model_validator(mode="after")
    def _check(self) -> RouteParameters:
        if self.stall_m > self.speed_m_s * self.stalled_s:
            raise InputError(
                "stall_m",
                f"{self.stall_m:g} m in stalled_s = {self.stalled_s:g} s is more "
                f"than speed_m_s = {self.speed_m_s:g} allows: the robot would "
                "always stall; lower it, or raise stalled_s",
            )
        check_cells(self.cell_m, self.clearance_m)
        return self
