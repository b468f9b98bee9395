"""The plane that robots share: geometry, paths, bodies that move on them."""

from systems.world.geometry import (
    control_point,
    control_point_velocity,
    rectangle_clearance,
    rectangle_corners,
)
from systems.world.obstacles import ObstacleParameters, Obstacles, Obstacles_
from systems.world.paths import WaypointPath

__all__ = [
    "ObstacleParameters",
    "Obstacles",
    "Obstacles_",
    "WaypointPath",
    "control_point",
    "control_point_velocity",
    "rectangle_clearance",
    "rectangle_corners",
]
