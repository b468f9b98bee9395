"""Range sensors, and the collision vector that they give."""

from typing import TYPE_CHECKING

from systems.framework.lazy import lazy_exports

if TYPE_CHECKING:
    from systems.ranging.collision_vector import (
        CollisionVector,
        CollisionVector_,
        collision_vectors,
    )
    from systems.ranging.ideal_obstacle_sensor import (
        IdealObstacleSensor,
        IdealObstacleSensor_,
        nearest_vectors,
    )
    from systems.ranging.parameters import (
        CollisionVectorParameters,
        UltrasonicParameters,
    )
    from systems.ranging.ultrasonic_array import UltrasonicArray, cone_ranges
else:
    __getattr__, __dir__ = lazy_exports(__name__)

__all__ = [
    "CollisionVector",
    "CollisionVectorParameters",
    "CollisionVector_",
    "IdealObstacleSensor",
    "IdealObstacleSensor_",
    "UltrasonicArray",
    "UltrasonicParameters",
    "collision_vectors",
    "cone_ranges",
    "nearest_vectors",
]
