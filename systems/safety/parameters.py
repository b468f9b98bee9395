"""Parameters of the guard and of its map."""

from __future__ import annotations

import math

from pydantic import Field

from systems.base.robot import RobotParameters, body_radius
from systems.framework.input_error import InputError
from systems.framework.parameters import (
    Acceleration,
    Fraction,
    NonNegativeLength,
    NonNegativeSpeed,
    Parameters,
)

#: Smaller margin, m, for a robot that has come nearer than ``margin_m`` because a model
#: was wrong.
LEAST_MARGIN_M = 0.003
#: Side of the square that the map remembers, m. The square moves along with the robot.
WINDOW_M = 12.8


class GuardParameters(Parameters):
    """How the guard keeps a robot in free space, and how it remembers this space."""

    obstacle_speed_m_s: NonNegativeSpeed | None = None
    """Largest speed, m/s, that the guard assumes for obstacles in view. With 0, it
    assumes that all obstacles are at rest. null: 0.6 m/s with the law ``guarded``, and
    0 with other laws."""
    braking_m_s2: Acceleration = 1.5
    """Deceleration of the faster wheel's rim when the guard brakes, m/s^2."""
    margin_m: float = Field(default=0.006, ge=LEAST_MARGIN_M, le=100.0)
    """Distance, m, that the guard keeps between the disc around the body and space that
    is not free, in addition to ``place_error_m``."""
    cell_m: float = Field(default=0.05, ge=0.005, le=0.25)
    """Side of a cell of the map, m."""
    start_bubble_m: float = Field(default=1.0, gt=0.0, le=WINDOW_M / 4.0)
    """Radius about the axle that is assumed to be free at the start, m."""
    wheel_error: Fraction = 0.0
    """Relative error of each wheel's travel, in addition to the pulses of its
    encoder."""
    place_error_m: NonNegativeLength = 0.006
    """Largest position error, m, of a cell that counts as free. The error is due to the
    encoders and ``wheel_error``. The guard keeps this distance in addition to its
    margin."""

    @property
    def cells(self) -> int:
        """Number of cells along a side of the map."""
        return math.ceil(WINDOW_M / self.cell_m - 1e-9)

    def check(self, robot: RobotParameters) -> None:
        """Checks that the start bubble holds a robot.

        Args:
            robot: Dimensions of its body.

        Raises:
            InputError: The bubble is too small.
        """
        radius = body_radius(robot)
        if self.start_bubble_m < radius + 2.0 * self.cell_m:
            raise InputError(
                "start_bubble_m",
                f"{self.start_bubble_m:g} m is too small for the body, which "
                f"turns within {radius:.3g} m, and two cells of {self.cell_m:g} "
                f"m; raise it to {radius + 2.0 * self.cell_m:.3g}, or lower "
                "cell_m",
            )
