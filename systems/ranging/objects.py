"""The port ``objects_W``: what a robot knows of the objects about it.

It has ``OBJECT_SLOTS`` slots of ``OBJECT_SIZE`` numbers, nearest first; empty slots are
zero. Their places in a slot:

- THERE: 1, or 0 in an empty slot;
- X, Y: vector from P to the object's nearest point in W axes, m;
- VX, VY: velocity of the object in W, m/s, and KNOWN: whether it is known, 0 or 1;
- RADIUS: of the disc behind the nearest point that stands for the object, m; 0: a point
  or a flat face;
- ROBOT: whether it is a robot, 0 or 1.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from systems.framework.block import Port
from systems.framework.compiling import njit
from systems.ranging.parameters import OBJECT_SIZE, OBJECT_SLOTS

THERE, X, Y, VX, VY, KNOWN, RADIUS, ROBOT = range(8)
#: Size of the port.
OBJECTS_SIZE = OBJECT_SLOTS * OBJECT_SIZE
#: Output port of every block that senses objects.
OBJECTS_PORT = Port(
    "objects_W",
    OBJECTS_SIZE,
    "number, m and m/s in eight slots, see systems.ranging.objects",
)


@njit(cache=True)
def nearest_objects(slots: Any) -> Any:  # pragma: no cover  (compiled)
    """What the port has of any number of objects.

    Args:
        slots: (n, OBJECT_SIZE) in any order.

    Returns:
        (OBJECT_SLOTS, OBJECT_SIZE) the nearest ones, nearest first.
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
