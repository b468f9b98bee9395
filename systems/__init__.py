"""The blocks: one LeafSystem a file, with its pure function beside it.

Templated blocks (float, AutoDiffXd) also have a name that ends in an
underscore, as in Drake: ``DiffDrivePlant`` is ``DiffDrivePlant_[float]``.
"""

from typing import TYPE_CHECKING

import systems.framework.compiling  # noqa: F401  # before anything is compiled
from systems.framework.lazy import lazy_exports

if TYPE_CHECKING:
    from systems.base.diff_drive_plant import DiffDrivePlant, DiffDrivePlant_
    from systems.base.source_robot import SourceRobot, SourceRobot_
    from systems.base.wheel_odometry import WheelOdometry, WheelOdometry_
    from systems.base.wheel_speed_command import (
        TwistWheelCommand,
        TwistWheelCommand_,
        VelocityWheelCommand,
        VelocityWheelCommand_,
        WheelSpeedCommand,
        WheelSpeedCommand_,
    )
    from systems.heading.compass import MagneticHeading
    from systems.heading.heading_controller import HeadingController
    from systems.heading.motor_driver import MotorDriver
    from systems.hearing.cross_power_estimator import CrossPowerEstimator
    from systems.hearing.ideal_source_sensor import (
        IdealSourceSensor,
        IdealSourceSensor_,
    )
    from systems.hearing.tdoa_estimator import TDOAEstimator
    from systems.hearing.tracking.source_tracker import SourceTracker, SourceTracker_
    from systems.hearing.voting.source_listener_block import SourceListener
    from systems.laws.active_impedance_2017_controller import (
        ActiveImpedance2017Controller,
        ActiveImpedance2017Controller_,
    )
    from systems.laws.active_impedance_controller import (
        ActiveImpedanceController,
        ActiveImpedanceController_,
    )
    from systems.laws.baselines.dynamic_window import DynamicWindowController
    from systems.laws.baselines.path_integral import PathIntegralController
    from systems.laws.baselines.reciprocal_avoidance import (
        ReciprocalAvoidanceController,
    )
    from systems.laws.baselines.stop_when_near import StopWhenNearController
    from systems.laws.baselines.vector_field_histogram import (
        VectorFieldHistogramController,
    )
    from systems.laws.conventional_impedance_2017_controller import (
        ConventionalImpedance2017Controller,
        ConventionalImpedance2017Controller_,
    )
    from systems.laws.conventional_impedance_controller import (
        ConventionalImpedanceController,
        ConventionalImpedanceController_,
    )
    from systems.laws.guarded_controller import GuardedController
    from systems.laws.radial_law_controller import (
        RadialLawController,
        RadialLawController_,
    )
    from systems.laws.trajectory.impedance_adaptation import ImpedanceAdaptation
    from systems.laws.trajectory.reference_model import ReferenceModel
    from systems.laws.trajectory.trajectory_impedance_controller import (
        TrajectoryImpedanceController,
        TrajectoryImpedanceController_,
    )
    from systems.odor.airflow_sensors import AirflowSensors
    from systems.odor.gas_sensor_array import GasSensorArray
    from systems.odor.odor_plume import OdorPlume
    from systems.odor.wind import WindField
    from systems.planning.safety_filter import SafetyFilter
    from systems.radio.radio_channel import RadioChannel
    from systems.radio.radio_range import RadioRange
    from systems.radio.sink_monitor import SinkMonitor
    from systems.ranging.collision_vector import CollisionVector, CollisionVector_
    from systems.ranging.contact_switches import ContactSwitches
    from systems.ranging.ideal_object_sensor import IdealObjectSensor
    from systems.ranging.ideal_obstacle_sensor import (
        IdealObstacleSensor,
        IdealObstacleSensor_,
    )
    from systems.ranging.object_detector import ObjectDetector
    from systems.ranging.ultrasonic_array import UltrasonicArray
    from systems.routes.global_planner import GlobalPlanner
    from systems.routes.path_target import PathTarget
    from systems.safety.free_space_map import FreeSpaceMap
    from systems.safety.motion_guard import MotionGuard
    from systems.safety.sensing_monitor import SensingMonitor
    from systems.search.plume_search import PlumeSearch
    from systems.search.sound_search import SoundSearch
    from systems.sound.mic_array import MicArray
    from systems.sound.sound_emitter import SoundEmitter
    from systems.world.obstacles import Obstacles, Obstacles_
else:
    __getattr__, __dir__ = lazy_exports(__name__)

__all__ = [
    "ActiveImpedance2017Controller",
    "ActiveImpedance2017Controller_",
    "ActiveImpedanceController",
    "ActiveImpedanceController_",
    "AirflowSensors",
    "CollisionVector",
    "CollisionVector_",
    "ContactSwitches",
    "ConventionalImpedance2017Controller",
    "ConventionalImpedance2017Controller_",
    "ConventionalImpedanceController",
    "ConventionalImpedanceController_",
    "CrossPowerEstimator",
    "DiffDrivePlant",
    "DiffDrivePlant_",
    "DynamicWindowController",
    "FreeSpaceMap",
    "GasSensorArray",
    "GlobalPlanner",
    "GuardedController",
    "HeadingController",
    "IdealObjectSensor",
    "IdealObstacleSensor",
    "IdealObstacleSensor_",
    "IdealSourceSensor",
    "IdealSourceSensor_",
    "ImpedanceAdaptation",
    "MagneticHeading",
    "MicArray",
    "MotionGuard",
    "MotorDriver",
    "ObjectDetector",
    "Obstacles",
    "Obstacles_",
    "OdorPlume",
    "PathIntegralController",
    "PathTarget",
    "PlumeSearch",
    "RadialLawController",
    "RadialLawController_",
    "RadioChannel",
    "RadioRange",
    "ReciprocalAvoidanceController",
    "ReferenceModel",
    "SafetyFilter",
    "SensingMonitor",
    "SinkMonitor",
    "SoundEmitter",
    "SoundSearch",
    "SourceListener",
    "SourceRobot",
    "SourceRobot_",
    "SourceTracker",
    "SourceTracker_",
    "StopWhenNearController",
    "TDOAEstimator",
    "TrajectoryImpedanceController",
    "TrajectoryImpedanceController_",
    "TwistWheelCommand",
    "TwistWheelCommand_",
    "UltrasonicArray",
    "VectorFieldHistogramController",
    "VelocityWheelCommand",
    "VelocityWheelCommand_",
    "WheelOdometry",
    "WheelOdometry_",
    "WheelSpeedCommand",
    "WheelSpeedCommand_",
    "WindField",
]
