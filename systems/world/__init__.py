"""The plane that robots share: geometry, paths, bodies that move on them."""

from typing import TYPE_CHECKING

from systems.framework.lazy import lazy_exports

if TYPE_CHECKING:
    from systems.world.geometry import (
        control_point,
        control_point_velocity,
        rectangle_clearance,
        rectangle_corners,
    )
    from systems.world.obstacles import Obstacles, Obstacles_
    from systems.world.parameters import ObstacleParameters
    from systems.world.paths import WaypointPath
else:
    __getattr__, __dir__ = lazy_exports(__name__)

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
