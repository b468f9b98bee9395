"""Parameters of the guard and of its map."""

from __future__ import annotations

import math

from pydantic import Field

from systems.framework.parameters import (
    Acceleration,
    Fraction,
    NonNegativeLength,
    NonNegativeSpeed,
    Parameters,
)

#: Distance that the guard keeps between the outline of the body and non-free space, m.
#: The guard keeps this distance in addition to ``place_error_m``.
MARGIN_M = 0.006
#: Smaller margin, m, that applies to a robot nearer than ``MARGIN_M``. A robot can come
#: this near if a model is wrong.
LEAST_MARGIN_M = 0.003
# The map remembers a square that moves along with the robot.
# ``WINDOW_M``: least side of the square, m.
# ``_WINDOW_RADII``: side of the square for a large robot, as a multiple of the radius
#   of the disc around its body. Two passages between which a larger robot chooses are
#   farther apart. If it forgot one at the other, it would drive back and forth.
# ``_MOST_CELLS``: largest number of cells along a side.
WINDOW_M = 12.8
_WINDOW_RADII, _MOST_CELLS = 28.0, 2560
#: Default of ``GuardParameters.start_bubble_m``.
START_BUBBLE_M = 1.0


class GuardParameters(Parameters):
    """Parameters of the guard, which keeps the robot in free space, and of its map."""

    obstacle_speed_m_s: NonNegativeSpeed | None = None
    """Largest speed that the guard assumes for obstacles in view, m/s. With 0, the
    guard assumes that all obstacles are at rest. With null, the speed is
    ``laws.guarded.obstacle_speed_m_s`` for the law ``guarded`` and 0 for other
    laws."""
    braking_m_s2: Acceleration = 1.5
    """Deceleration of the faster wheel's rim when the guard brakes, m/s^2."""
    cell_m: float = Field(default=0.05, ge=0.005, le=0.25)
    """Side of a cell of the map, m."""
    wheel_error: Fraction = 0.0
    """Relative error of the travel of each wheel. Errors due to the pulses of the
    encoders are not included."""
    place_error_m: NonNegativeLength = 0.006
    """Largest position error of a cell that counts as free, m. The encoders and
    ``wheel_error`` cause this error. The guard keeps this distance, and 6 mm more,
    between the outline of the body and non-free space."""
    start_bubble_m: float = Field(default=START_BUBBLE_M, ge=0.0, le=WINDOW_M / 2.0)
    """Radius of the start bubble, m. This disc around the axle counts as free at the
    start, in addition to the floor under the body. With 0, the robot starts to move
    only where its sensors have seen free floor next to the body."""

    def cells_for(self, radius_m: float) -> int:
        """Returns the number of cells along a side of the map.

        ``radius_m`` is the radius of the disc around the axle that contains the body.
        """
        side_m = max(WINDOW_M, _WINDOW_RADII * radius_m)
        return min(math.ceil(side_m / self.cell_m - 1e-9), _MOST_CELLS)
