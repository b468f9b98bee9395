"""Dimensions of the follower, which several blocks share."""

from __future__ import annotations

import math
from functools import cached_property
from itertools import combinations
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, Strict, model_validator

from systems.base.robot_presets import ROBOT_PRESETS, RobotPreset
from systems.framework.input_error import InputError
from systems.framework.parameters import (
    Length,
    Mass,
    Parameters,
    Point,
    Speed,
    with_preset,
)

#: Least distance between two microphones, m.
LEAST_SPACING_M = 1e-3


class RobotParameters(Parameters):
    """Dimensions of the follower robot (Han 2019, table 6).

    The table prints "350 (W) x 820 (L)", a wheel distance of 410 mm, and a microphone
    row of 800 mm. The row is lateral, so 820 mm must be the width. Therefore this class
    exchanges the two printed sizes.
    """

    preset: RobotPreset = "han2019"
    """Named robot. It gives the values of all other fields that are not set."""
    length_m: Annotated[Length, Field(le=10.0)] = 0.35
    """Extent of the body along its x axis, m."""
    width_m: Annotated[Length, Field(le=10.0)] = 0.82
    """Extent of the body along its y axis, including the microphone bar, m."""
    control_point_m: Length = 0.175
    """Distance epsilon of the control point P ahead of the axle, m."""
    microphones_m: Annotated[tuple[Point, ...], Strict(False), Field(min_length=3)] = (
        (0.0, 0.4),
        (0.0, 0.0),
        (0.0, -0.4),
    )
    """Positions of the microphones relative to the control point P, in the axes of the
    body frame B, m. There must be at least three. No two may be within 1 mm.

    The default is a row from left to right with 0.4 m between neighbors (Han 2019,
    2.3).
    """
    wheel_radius_m: Length = 0.06
    """Radius of the driven wheels, m."""
    wheel_separation_m: Length = 0.41
    """Distance L between the driven wheels, m."""
    mass_kg: Mass = 3.94
    """Virtual mass M at P, kg. It equals the mass of the robot."""
    top_speed_m_s: Speed = 0.72
    """Largest speed of the control point P, and largest rim speed of each wheel, m/s
    (Han 2019, 5.3)."""

    @model_validator(mode="before")
    @classmethod
    def _fill(cls, data: Any) -> Any:
        return with_preset(data, ROBOT_PRESETS)

    @model_validator(mode="after")
    def _check_microphones(self) -> RobotParameters:
        for (i, a), (j, b) in combinations(enumerate(self.microphones_m), 2):
            if math.dist(a, b) < LEAST_SPACING_M:
                raise InputError(
                    "microphones_m",
                    f"microphones {i} and {j}, at {a} and {b}, are "
                    f"less than {LEAST_SPACING_M:g} m apart; move one",
                )
        return self

    @cached_property
    def top_wheel_speed(self) -> float:
        """Largest wheel speed, rad/s."""
        return self.top_speed_m_s / self.wheel_radius_m


def body_radius(robot: RobotParameters) -> float:
    """Returns the radius of the disc around the axle that contains the body, m."""
    return 0.5 * math.hypot(robot.length_m, robot.width_m)


def microphones_B(robot: RobotParameters) -> NDArray[np.float64]:
    """Returns the (n, 2) microphone positions in B, m, in the order of the channels."""
    return np.add(robot.microphones_m, [robot.control_point_m, 0.0])
