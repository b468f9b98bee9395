"""Bodies with wheels: the robot's drive and odometry, and the source's carrier."""

from systems.base.carrier import CarrierParameters, DrivenPath
from systems.base.diff_drive_plant import (
    DiffDrivePlant,
    DiffDrivePlant_,
    PlantParameters,
    plant_derivatives,
)
from systems.base.robot import RobotParameters
from systems.base.source_robot import SourceRobot, SourceRobot_, SourceRobotParameters
from systems.base.tyre_grip import grip_accelerations
from systems.base.wheel_odometry import (
    OdometryParameters,
    WheelOdometry,
    WheelOdometry_,
    advance_pose,
)
from systems.base.wheel_speed_command import (
    TwistWheelCommand,
    TwistWheelCommand_,
    VelocityWheelCommand,
    VelocityWheelCommand_,
    WheelSpeedCommand,
    WheelSpeedCommand_,
    hand_position_twist,
)

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
    "grip_accelerations",
    "hand_position_twist",
    "plant_derivatives",
]
