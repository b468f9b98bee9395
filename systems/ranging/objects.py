"""Defines the port ``objects_W``, which has the objects around a robot.

The port has ``OBJECT_SLOTS`` slots of ``OBJECT_SIZE`` numbers, nearest object first.
Empty slots are zero. P is the control point of the robot, and W is the world frame. A
slot has these elements:

- THERE: 1 if the slot has an object, 0 if the slot is empty.
- X, Y: vector from P to the nearest point of the object, in the axes of W, m.
- VX, VY: velocity of the object in W, m/s.
- KNOWN: 1 if the velocity is known, otherwise 0.
- RADIUS: radius of the disc that represents the object, m. The nearest point is on the
  edge of the disc. The radius is 0 for a point or a flat face.
- ROBOT: 1 if the object is a robot, otherwise 0.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from systems.framework.block import Port
from systems.framework.compiling import njit
from systems.ranging.parameters import OBJECT_SIZE, OBJECT_SLOTS
from systems.world.geometry import beyond_rectangle

THERE, X, Y, VX, VY, KNOWN, RADIUS, ROBOT = range(8)
#: Number of elements of the port.
OBJECTS_SIZE = OBJECT_SLOTS * OBJECT_SIZE
#: Output port of every block that senses objects.
OBJECTS_PORT = Port(
    "objects_W",
    OBJECTS_SIZE,
    "number, m and m/s in eight slots, see systems.ranging.objects",
)

#: Objects below this speed count as at rest, m/s.
_RESTS_M_S = 0.02
#: An object whose nearest point is this near to a known obstacle is part of it, m (our
#: choice).
ON_MAP_M = 0.1


@njit(cache=True)
def is_moving(objects: Any, at: int) -> bool:  # pragma: no cover  (compiled)
    """Checks whether an object is known to move.

    ``objects`` is the value of the port, and ``at`` the index of the slot's first
    element in it.
    """
    speed = math.hypot(objects[at + VX], objects[at + VY])
    return bool(objects[at + KNOWN] > 0.5 and speed > _RESTS_M_S)


@njit(cache=True)
def is_on_map(
    x: float, y: float, rectangles: Any, near_m: float = ON_MAP_M
) -> bool:  # pragma: no cover  (compiled)
    """Checks whether the nearest point of an object belongs to a known obstacle.

    Args:
        x: x coordinate of the point in the world frame W, m.
        y: y coordinate of the point in W, m.
        rectangles: (k, 6) rectangles of known obstacles (x, y, theta, length, width,
            radius) in W, m and rad.
        near_m: Distance from a known obstacle below which the point belongs to it, m.

    Returns:
        Whether a known obstacle is nearer to the point than ``near_m``.
    """
    for k in range(len(rectangles)):
        du, dv = beyond_rectangle((x, y), rectangles[k])
        if math.hypot(du, dv) < near_m:
            return True
    return False


@njit(cache=True)
def nearest_objects(slots: Any) -> Any:  # pragma: no cover  (compiled)
    """Selects the nearest objects, at most one object per slot of the port.

    Args:
        slots: (n, OBJECT_SIZE) objects and empty slots, in any order.

    Returns:
        (OBJECT_SLOTS, OBJECT_SIZE) objects, nearest first. Unused slots are zero.
    """
    chosen = np.zeros((OBJECT_SLOTS, OBJECT_SIZE))
    away = np.hypot(slots[:, X], slots[:, Y])
    for k in range(len(slots)):
        if slots[k, THERE] < 0.5:
            away[k] = np.inf
    for k in range(min(OBJECT_SLOTS, len(slots))):
        nearest = np.argmin(away)
        if away[nearest] == np.inf:
            break
        away[nearest] = np.inf
        for j in range(OBJECT_SIZE):
            chosen[k, j] = slots[nearest, j]
    return chosen
