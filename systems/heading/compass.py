"""The magnetic compass: heading from two components of the magnetic field."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from numba.extending import register_jitable

from systems.framework.block import Block, Port, Step
from systems.framework.noise import TickNoise, tick_noise, tick_normals
from systems.framework.signals import TICK_S
from systems.heading.parameters import CompassParameters


@register_jitable
def wrapped_deg(angle: float) -> float:
    """Wraps an angle to (-180, 180] deg.

    Args:
        angle: Angle, deg.
    """
    return 180.0 - (180.0 - angle) % 360.0


@register_jitable
def field_in_body(theta: float, numbers: Any) -> tuple[float, float]:
    """Computes the horizontal magnetic field at the sensor, with its distortions.

    Args:
        theta: Heading of B in W, CCW, rad.
        numbers: Object with the fields ``north_deg``, ``hard_iron`` and ``soft_iron``.

    Returns:
        (Hx, Hy) along x (ahead) and y (left) of B, divided by the horizontal field of
        the earth.
    """
    north = math.radians(numbers.north_deg) - theta
    hx = numbers.soft_iron[0] * math.cos(north) + numbers.hard_iron[0]
    hy = numbers.soft_iron[1] * math.sin(north) + numbers.hard_iron[1]
    return hx, hy


@register_jitable
def heading_of_field(hx: float, hy: float) -> float:
    """Computes the heading from the magnetic field (Song 2011, eq. 7).

    The printed arctangent of a ratio is wrong in two quadrants. This function uses the
    arctangent of two arguments.

    Args:
        hx: Component ahead.
        hy: Component to the left.

    Returns:
        Heading clockwise from magnetic north, -180 to 180 deg.
    """
    return math.degrees(math.atan2(hy, hx))


class CompassNumbers(NamedTuple):
    """Constants of the step of ``MagneticHeading``."""

    own: CompassParameters
    noise: TickNoise


@register_jitable
def magnetic_heading_step(
    tick: int, state: Any, inputs: Any, outputs: Any, numbers: CompassNumbers
) -> None:
    """Computes the heading that the compass measures."""
    hx, hy = field_in_body(inputs[0][2], numbers.own)
    heading = heading_of_field(hx, hy)
    if numbers.own.noise_deg > 0.0:
        normals = tick_normals(numbers.noise, tick, 1, 2)
        heading += numbers.own.noise_deg * float(normals[0, 0])
    outputs[0][0] = wrapped_deg(heading)


class MagneticHeading(Block):
    """Measures the heading from the magnetic field of the earth.

    The headings of Song 2011 are clockwise from north. Angles in W are
    counterclockwise.

    The block has no state. It draws new noise every tick. There is no latency.

    Args:
        parameters: North, distortions of the field, and noise.
        seed: Seed of the noise.
        tick_s: Period of the robot, s.

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
        numbers = CompassNumbers(parameters, tick_noise(seed))
        self.declare(Step(magnetic_heading_step, numbers), tick_s=tick_s)
