"""Range sensors, and the collision vector that they give."""

from systems.ranging.collision_vector import (
    CollisionVector,
    CollisionVector_,
    CollisionVectorParameters,
    collision_vectors,
)
from systems.ranging.ideal_obstacle_sensor import (
    IdealObstacleSensor,
    IdealObstacleSensor_,
    nearest_vectors,
)
from systems.ranging.ultrasonic_array import (
    UltrasonicArray,
    UltrasonicParameters,
    cone_ranges,
)

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
