"""Parameters of routes and of the targets on them."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from systems.framework.parameters import Acceleration, Parameters, Point


class RouteParameters(Parameters):
    """Fields of a route: goal, clearance, and motion of the target along the route.

    All values are our choice. Engelbrecht, Steyn and Djouani (2021) give no values.
    """

    speed_m_s: float = Field(default=0.15, ge=0.02, le=100.0)
    """Speed of the target along the route, m/s. Below 0.02 m/s, the planner would treat
    the robot as stalled.
    """
    acceleration_m_s2: Acceleration = 0.15
    """Acceleration of the target from rest and to rest, m/s^2."""
    timing: Literal["timed", "waiting"] = "timed"
    """Motion of the target. ``timed``: the motion depends only on time, as in the
    paper. ``waiting``: when the target is 0.5 m ahead of the control point P, it waits
    for the robot.
    """
    goal_m: Point = (4.0, 0.0)
    """Goal of P in W, m."""
    clearance_m: float = Field(default=0.35, ge=0.15, le=1_000.0)
    """Planned distance between the route and known obstacles, m. Where no route has
    this distance, the planner accepts less, down to half of the width of the body plus
    0.025 m. Rounded corners may reduce the distance to 92 %. The planner's grid has
    cells of 0.05 m, which are too coarse for less than 0.15 m.
    """
    replan: bool = True
    """Whether a stalled robot plans a new route around the obstacles that it has
    seen."""
