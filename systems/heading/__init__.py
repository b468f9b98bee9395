"""From a wanted heading to the wheels: compass, heading controller, motors."""

from typing import TYPE_CHECKING

from systems.framework.lazy import lazy_exports

if TYPE_CHECKING:
    from systems.heading.compass import MagneticHeading
    from systems.heading.heading_controller import HeadingController
    from systems.heading.motor_driver import MotorDriver
    from systems.heading.parameters import (
        CompassParameters,
        HeadingControlParameters,
        MotorDriverParameters,
    )
else:
    __getattr__, __dir__ = lazy_exports(__name__)

__all__ = [
    "CompassParameters",
    "HeadingControlParameters",
    "HeadingController",
    "MagneticHeading",
    "MotorDriver",
    "MotorDriverParameters",
]
