"""A world: obstacles at rest, a start, a goal, and the length of a reference path."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

#: Start, start heading, and goal of the BARN challenge in W, m and deg. Files without
#: these values have them.
START_M, HEADING_DEG, GOAL_M = (-2.25, 3.0), 90.0, (-2.25, 13.0)
#: Radius of the cylinders of the BARN challenge, m.
RADIUS_M = 0.075


@dataclass(frozen=True)
class World:
    """One world of a set. Positions are in the world frame W, in m."""

    name: str
    obstacles: tuple[Mapping[str, Any], ...]
    """Fields of each obstacle, as in ``obstacles`` of a scenario."""
    start_m: tuple[float, float] = START_M
    heading_deg: float = HEADING_DEG
    goal_m: tuple[float, float] = GOAL_M
    path_length_m: float | None = None
    """Length of the reference path from start to goal. None: not known."""
    map_file: str | None = None
    """Full path of a map with further obstacles, see ``map.file`` of a scenario."""

    def fields(self, data: Mapping[str, Any]) -> dict[str, Any]:
        """Returns the fields of a scenario that the world determines.

        Args:
            data: Other fields of the scenario. If it has a route or a source, the goal
                of the world is the goal of the route, or the place of the source.

        Returns:
            Plain values by name of the field.
        """
        goal = [*self.goal_m]
        target: dict[str, Any] = {"goal_m": goal}
        if data.get("goal_m") is None and data.get("route") is not None:
            target = {"route": {"goal_m": goal}}
        elif data.get("goal_m") is None and data.get("source") is not None:
            target = {"source": {"waypoints_m": [goal]}}
        return {
            "obstacles": [dict(each) for each in self.obstacles],
            "start": {
                "position_m": [*self.start_m],
                "heading_deg": self.heading_deg,
            },
            **target,
            "map": None if self.map_file is None else {"file": self.map_file},
            "reference_path_m": self.path_length_m,
        }


def cylinder(number: int, x: float, y: float, radius: float) -> dict[str, Any]:
    """Returns the fields of an obstacle that is a cylinder; lengths in m."""
    return {
        "name": f"cylinder {number}",
        "radius_m": radius,
        "waypoints_m": [[x, y]],
    }
