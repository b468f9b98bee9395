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
#: Side of the square that the map remembers, m. The square moves along with the robot.
WINDOW_M = 12.8
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

    @property
    def cells(self) -> int:
        """Number of cells along a side of the map."""
        return math.ceil(WINDOW_M / self.cell_m - 1e-9)
