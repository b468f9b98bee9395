"""Parameters of the memory of space and of the guard."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from systems.base.robot import RobotParameters, body_radius
from systems.framework.input_error import InputError
from systems.framework.parameters import (
    Acceleration,
    Fraction,
    Length,
    NonNegativeLength,
    NonNegativeSpeed,
    Parameters,
)
from systems.ranging.parameters import UltrasonicParameters

#: Largest number of cells along a side of a window: 16 million cells take 0.4 GB.
_MOST_CELLS = 4_000

#: The error of a range is below this many standard deviations.
_SIGMAS = 5.0


class FreeSpaceParameters(Parameters):
    """How the robot remembers free space."""

    cell_m: float = Field(default=0.05, ge=0.005, le=0.25)
    """Side of a cell, m."""
    window_m: Length = 12.8
    """Side of the remembered square, m. The square moves along with the robot."""
    start_bubble_m: Length = 1.0
    """Radius about the axle that is assumed to be free at the start, m."""
    range_margin_m: NonNegativeLength = 0.002
    """Largest amount, m, by which a range is too long, in addition to five standard
    deviations of its noise."""
    wheel_error: Fraction = 0.0
    """Relative error of each wheel's travel, in addition to the pulses of its
    encoder."""
    place_error_m: NonNegativeLength = 0.006
    """Largest position error, m, of a cell that counts as free. The error is due to the
    encoders and ``wheel_error``. The guard keeps this distance in addition to its
    margin."""

    @property
    def cells(self) -> int:
        """Number of cells along a side of the window."""
        return math.ceil(self.window_m / self.cell_m - 1e-9)

    def range_errors(self, sensors: UltrasonicParameters) -> NDArray[np.float64]:
        """(n,) largest amounts by which the ranges of each sensor are too long, m."""
        return self.range_margin_m + _SIGMAS * sensors.each("noise_m")

    def check(self, robot: RobotParameters) -> None:
        """Checks that the grid fits a robot.

        Args:
            robot: Dimensions of its body.

        Raises:
            InputError: The grid is too coarse, too large or too small.
        """
        radius = body_radius(robot)
        if self.cells > _MOST_CELLS:
            raise InputError(
                "window_m",
                f"{self.window_m:g} m in cells of {self.cell_m:g} m are {self.cells}^2 "
                f"cells, more than {_MOST_CELLS}^2; lower it, or raise cell_m",
            )
        if self.start_bubble_m < radius + 2.0 * self.cell_m:
            raise InputError(
                "start_bubble_m",
                f"{self.start_bubble_m:g} m is too small for the body, which "
                f"turns within {radius:.3g} m, and two cells of {self.cell_m:g} "
                f"m; raise it to {radius + 2.0 * self.cell_m:.3g}, or lower "
                "cell_m",
            )
        if self.window_m < 4.0 * self.start_bubble_m:
            raise InputError(
                "window_m",
                f"{self.window_m:g} m is less than four times the bubble of "
                f"{self.start_bubble_m:g} m; raise it",
            )


class GuardParameters(Parameters):
    """How the guard keeps a robot in free space."""

    obstacle_speed_m_s: NonNegativeSpeed = 0.0
    """Largest speed, m/s, that the guard assumes for obstacles in view. With 0, it
    assumes that all obstacles are at rest."""
    braking_m_s2: Acceleration = 1.5
    """Deceleration of the faster wheel's rim when the guard brakes, m/s^2."""
    margin_m: NonNegativeLength = 0.006
    """Distance, m, that the guard keeps between the disc around the body and space that
    is not free, in addition to ``free_space.place_error_m``."""
    least_margin_m: NonNegativeLength = 0.003
    """Smaller margin, m, for a robot that has come nearer than ``margin_m`` because a
    model was wrong."""
    slow_turn_rad_s: float = Field(default=0.3, ge=0.0, le=10.0)
    """A robot that turns on the spot no faster than this counts as at rest, rad/s."""

    @model_validator(mode="after")
    def _check(self) -> GuardParameters:
        if self.least_margin_m > self.margin_m:
            raise InputError(
                "least_margin_m",
                f"{self.least_margin_m:g} is above margin_m {self.margin_m:g}; "
                "lower it",
            )
        return self
