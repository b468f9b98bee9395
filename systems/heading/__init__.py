"""From a wanted heading to the wheels: compass, heading controller, motors."""

from systems.heading.compass import CompassParameters, MagneticHeading
from systems.heading.heading_controller import (
    HeadingController,
    HeadingControlParameters,
)
from systems.heading.motor_driver import MotorDriver, MotorDriverParameters

__all__ = [
    "CompassParameters",
    "HeadingControlParameters",
    "HeadingController",
    "MagneticHeading",
    "MotorDriver",
    "MotorDriverParameters",
]
