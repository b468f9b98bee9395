"""The magnetic compass: heading from two components of the magnetic field."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from numba.extending import register_jitable

from systems.framework.block import Block, Port, Step
from systems.framework.noise import TickNoise, tick_noise, tick_normals
from systems.framework.signals import TICK_S
from systems.heading.parameters import CompassParameters

#: Direction of magnetic north in W, CCW from the x axis of W, rad.
_NORTH_RAD = math.radians(90.0)


@register_jitable
def wrapped_deg(angle: float) -> float:
    """Wraps an angle in deg to the range above -180 and up to 180."""
    return 180.0 - (180.0 - angle) % 360.0


class CompassNumbers(NamedTuple):
    """Constants of the step of ``MagneticHeading``."""

    noise_deg: float
    noise: TickNoise


@register_jitable
def magnetic_heading_step(
    tick: int, state: Any, inputs: Any, outputs: Any, numbers: CompassNumbers
) -> None:
    """Computes the heading that the compass measures."""
    north = _NORTH_RAD - inputs[0][2]
    # The magnetic field ahead and to the left, in units of its horizontal strength.
    ahead, left = math.cos(north), math.sin(north)
    heading = math.degrees(math.atan2(left, ahead))
    normals = tick_normals(numbers.noise, tick, 1, 2)
    heading += numbers.noise_deg * float(normals[0, 0])
    outputs[0][0] = wrapped_deg(heading)


class MagneticHeading(Block):
    """Measures the heading of a robot from the magnetic field of the earth.

    The measured heading is clockwise from north, as in Song 2011. Angles in the world
    frame W are counterclockwise. In the model, no iron in the robot distorts the field.

    The block has no state. It draws new noise at every tick (control period). There is
    no latency.

    Args:
        parameters: Standard deviation of the noise.
        seed: Seed of the noise.
        tick_s: Control period of the robot, s.

    Reference: Song 2011, eq. 7, with an arctangent of two arguments.
    """

    part = "compass"
    inputs = (Port("pose_WB", 3, "m, m, rad"),)
    outputs = (Port("heading_deg", 1, "deg, clockwise from north", "heading_deg"),)

    def __init__(
        self,
        *,
        parameters: CompassParameters = CompassParameters(),
        seed: int = 0,
        tick_s: float = TICK_S,
    ) -> None:
        super().__init__()
        self.set_name("magnetic_heading")
        numbers = CompassNumbers(parameters.noise_deg, tick_noise(seed))
        self.declare(Step(magnetic_heading_step, numbers), tick_s=tick_s)
