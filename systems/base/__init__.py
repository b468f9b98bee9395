"""Bodies with wheels: the robot's drive and odometry, and the source's carrier."""

from typing import TYPE_CHECKING

from systems.framework.lazy import lazy_exports

if TYPE_CHECKING:
    from systems.base.carrier_parameters import CarrierParameters, SourceRobotParameters
    from systems.base.diff_drive_plant import (
        DiffDrivePlant,
        DiffDrivePlant_,
        plant_derivatives,
    )
    from systems.base.driven_path import DrivenPath
    from systems.base.parameters import OdometryParameters, PlantParameters
    from systems.base.robot import RobotParameters, body_radius, microphones_B
    from systems.base.source_robot import SourceRobot, SourceRobot_
    from systems.base.tyre_grip import grip_accelerations
    from systems.base.wheel_odometry import WheelOdometry, WheelOdometry_, advance_pose
    from systems.base.wheel_speed_command import (
        TwistWheelCommand,
        TwistWheelCommand_,
        VelocityWheelCommand,
        VelocityWheelCommand_,
        WheelSpeedCommand,
        WheelSpeedCommand_,
        hand_position_twist,
    )
else:
    __getattr__, __dir__ = lazy_exports(__name__)

__all__ = [
    "CarrierParameters",
    "DiffDrivePlant",
    "DiffDrivePlant_",
    "DrivenPath",
    "OdometryParameters",
    "PlantParameters",
    "RobotParameters",
    "SourceRobot",
    "SourceRobotParameters",
    "SourceRobot_",
    "TwistWheelCommand",
    "TwistWheelCommand_",
    "VelocityWheelCommand",
    "VelocityWheelCommand_",
    "WheelOdometry",
    "WheelOdometry_",
    "WheelSpeedCommand",
    "WheelSpeedCommand_",
    "advance_pose",
    "body_radius",
    "grip_accelerations",
    "hand_position_twist",
    "microphones_B",
    "plant_derivatives",
]
