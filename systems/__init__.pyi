from .base.diff_drive_plant import (
    DiffDrivePlant as DiffDrivePlant,
    DiffDrivePlant_ as DiffDrivePlant_,
)
from .base.source_robot import (
    SourceRobot as SourceRobot,
    SourceRobot_ as SourceRobot_,
)
from .base.wheel_odometry import (
    WheelOdometry as WheelOdometry,
    WheelOdometry_ as WheelOdometry_,
)
from .base.wheel_speed_command import (
    WheelCommand as WheelCommand,
    WheelCommand_ as WheelCommand_,
    WheelSpeedCommand as WheelSpeedCommand,
)
from .framework.block import (
    OBJECT as OBJECT,
    Block as Block,
    Port as Port,
    Step as Step,
)
from .heading.compass import MagneticHeading as MagneticHeading
from .heading.heading_controller import HeadingController as HeadingController
from .heading.motor_driver import MotorDriver as MotorDriver
from .hearing.cross_power_estimator import CrossPowerEstimator as CrossPowerEstimator
from .hearing.ideal_source_sensor import (
    IdealSourceSensor as IdealSourceSensor,
    IdealSourceSensor_ as IdealSourceSensor_,
)
from .hearing.tdoa_estimator import TDOAEstimator as TDOAEstimator
from .hearing.tracking.source_tracker import (
    SourceTracker as SourceTracker,
    SourceTracker_ as SourceTracker_,
)
from .laws.baselines.dynamic_window_controller import (
    DynamicWindowController as DynamicWindowController,
)
from .laws.baselines.path_integral_controller import (
    PathIntegralController as PathIntegralController,
)
from .laws.baselines.reciprocal_avoidance_controller import (
    ReciprocalAvoidanceController as ReciprocalAvoidanceController,
)
from .laws.baselines.stop_when_near_controller import (
    StopWhenNearController as StopWhenNearController,
)
from .laws.baselines.vector_field_histogram_controller import (
    VectorFieldHistogramController as VectorFieldHistogramController,
)
from .laws.guarded_controller import GuardedController as GuardedController
from .laws.impedance_controller import (
    ActiveImpedance2017Controller as ActiveImpedance2017Controller,
    ActiveImpedance2017Controller_ as ActiveImpedance2017Controller_,
    ActiveImpedanceController as ActiveImpedanceController,
    ActiveImpedanceController_ as ActiveImpedanceController_,
    ConventionalImpedance2017Controller as ConventionalImpedance2017Controller,
    ConventionalImpedance2017Controller_ as ConventionalImpedance2017Controller_,
    ConventionalImpedanceController as ConventionalImpedanceController,
    ConventionalImpedanceController_ as ConventionalImpedanceController_,
    ImpedanceController as ImpedanceController,
    ImpedanceController_ as ImpedanceController_,
    RadialLawController as RadialLawController,
    RadialLawController_ as RadialLawController_,
)
from .laws.trajectory.impedance_adaptation import (
    ImpedanceAdaptation as ImpedanceAdaptation,
)
from .laws.trajectory.reference_model import ReferenceModel as ReferenceModel
from .laws.trajectory.trajectory_impedance_controller import (
    TrajectoryImpedanceController as TrajectoryImpedanceController,
    TrajectoryImpedanceController_ as TrajectoryImpedanceController_,
)
from .odor.airflow_sensors import AirflowSensors as AirflowSensors
from .odor.gas_sensor_array import GasSensorArray as GasSensorArray
from .odor.odor_plume import OdorPlume as OdorPlume
from .odor.wind import WindField as WindField
from .planning.safety_filter import SafetyFilter as SafetyFilter
from .radio.radio_channel import RadioChannel as RadioChannel
from .radio.radio_range import RadioRange as RadioRange
from .radio.sink_monitor import SinkMonitor as SinkMonitor
from .ranging.collision_vector import (
    CollisionVector as CollisionVector,
    CollisionVector_ as CollisionVector_,
)
from .ranging.contact_switches import ContactSwitches as ContactSwitches
from .ranging.ideal_object_sensor import IdealObjectSensor as IdealObjectSensor
from .ranging.ideal_obstacle_sensor import (
    IdealObstacleSensor as IdealObstacleSensor,
    IdealObstacleSensor_ as IdealObstacleSensor_,
)
from .ranging.object_detector import ObjectDetector as ObjectDetector
from .ranging.ultrasonic_array import UltrasonicArray as UltrasonicArray
from .routes.global_planner import GlobalPlanner as GlobalPlanner
from .routes.path_target import PathTarget as PathTarget
from .safety.free_space_map import FreeSpaceMap as FreeSpaceMap
from .safety.motion_guard import MotionGuard as MotionGuard
from .safety.sensing_monitor import SensingMonitor as SensingMonitor
from .search.plume_search import PlumeSearch as PlumeSearch
from .search.sound_search import SoundSearch as SoundSearch
from .sound.mic_array import MicArray as MicArray
from .sound.sound_emitter import SoundEmitter as SoundEmitter
from .world.obstacles import (
    Obstacles as Obstacles,
    Obstacles_ as Obstacles_,
)

__all__: list[str]
