"""The fields of each robot and of each source in a scenario."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field, Strict, field_validator, model_validator

from diagrams.scenario.fields.near_miss import unknown_law
from systems.base.carrier_parameters import SourceRobotParameters
from systems.base.parameters import OdometryParameters, PlantParameters
from systems.base.robot import RobotParameters
from systems.framework.faults import Faults, FaultySensor, faults_of
from systems.framework.parameters import Angle, Parameters, Point
from systems.heading.parameters import (
    CompassParameters,
    HeadingControlParameters,
    MotorDriverParameters,
)
from systems.hearing.parameters import (
    CrossPowerParameters,
    IdealHearingParameters,
    TDOAParameters,
    TrackerParameters,
)
from systems.laws.catalogue import LAWS
from systems.laws.parameters import AttractionParameters
from systems.laws.repulsion import RepulsionParameters
from systems.odor.parameters import (
    GAS_SENSORS,
    AirflowParameters,
    GasSensorParameters,
)
from systems.planning.parameters import FollowingParameters
from systems.ranging.parameters import (
    CollisionVectorParameters,
    ObjectDetectorParameters,
    ObjectSensorParameters,
    UltrasonicParameters,
)
from systems.routes.parameters import RouteParameters
from systems.safety.parameters import FreeSpaceParameters, GuardParameters
from systems.search.parameters import PlumeSearchParameters, SoundSearchParameters
from systems.sound.parameters import MicArrayParameters, SoundParameters, channel_skew


class StartParameters(Parameters):
    """Pose of the robot at the start, where it is at rest."""

    position_m: Point = (0.0, 0.0)
    """Origin of B in W, m."""
    heading_deg: Angle = 0.0
    """Heading, deg CCW from the x axis of W."""

    @property
    def pose(self) -> tuple[float, float, float]:
        """(x, y, theta), m and rad."""
        return (*self.position_m, math.radians(self.heading_deg))


class FollowerParameters(Parameters):
    """One robot: its law, hearing, sensors and body."""

    law: str = Field(default="active", min_length=1)
    """Name of a law in the list of ``phonotaxis laws``; or a user's own law, as
    ``package.module:Name`` or ``path/to/file.py:Name``."""
    hearing: Literal["audio", "ideal"] = "audio"
    """``audio``: sound waves and microphones; ``ideal``: exact positions."""
    obstacle_sensing: Literal["ultrasonic", "ideal"] = "ultrasonic"
    """``ultrasonic``: sensors with cones; ``ideal``: exact nearest points."""
    blocks: Annotated[tuple[str, ...], Strict(False), Field(max_length=32)] = ()
    """A user's own blocks, as ``package.module:Name`` or ``path/to/file.py:Name``. Each
    replaces the robot's block with the same part; a block with a new part is added."""
    follows: str = ""
    """Name of the source or the leader to follow; empty: the first source."""
    loudspeaker: SoundParameters | None = None
    """Sound that the robot itself plays at the origin of B, so that other robots can
    follow it."""
    start: StartParameters = StartParameters()
    microphones: MicArrayParameters = MicArrayParameters()
    tdoa: TDOAParameters = TDOAParameters()
    ideal_hearing: IdealHearingParameters = IdealHearingParameters()
    tracker: TrackerParameters = TrackerParameters()
    ultrasonic: UltrasonicParameters = UltrasonicParameters()
    collision_vector: CollisionVectorParameters = CollisionVectorParameters()
    attraction: AttractionParameters = AttractionParameters()
    repulsion: RepulsionParameters = RepulsionParameters()
    following: FollowingParameters = FollowingParameters()
    robot: RobotParameters = RobotParameters()
    plant: PlantParameters = PlantParameters()
    odometry: OdometryParameters = OdometryParameters()
    route: RouteParameters | None = None
    """Goal and planner of a robot that drives on a planned route; null: the robot does
    not drive on a route."""
    objects: ObjectSensorParameters = ObjectSensorParameters()
    detector: ObjectDetectorParameters = ObjectDetectorParameters()
    guard: GuardParameters | None = None
    """The guard works with any law and keeps the robot in space that its sensors have
    seen as free; null: no guard, unless the law is ``guarded``."""
    free_space: FreeSpaceParameters = FreeSpaceParameters()
    search: PlumeSearchParameters = PlumeSearchParameters()
    gas_sensors: GasSensorParameters = GasSensorParameters()
    airflow_sensors: AirflowParameters = AirflowParameters()
    sound_search: SoundSearchParameters = SoundSearchParameters()
    cross_power: CrossPowerParameters = CrossPowerParameters()
    compass: CompassParameters = CompassParameters()
    heading_control: HeadingControlParameters = HeadingControlParameters()
    motor_driver: MotorDriverParameters = MotorDriverParameters()
    faults: Faults = ()
    """Sensors that fail during a run."""

    @field_validator("law")
    @classmethod
    def _check_law(cls, law: str) -> str:
        if ":" not in law and law not in LAWS:
            raise unknown_law(law, LAWS)
        return law

    @model_validator(mode="after")
    def _check_channels(self) -> FollowerParameters:
        channel_skew(self.microphones, len(self.robot.microphones_m))
        return self

    @model_validator(mode="after")
    def _check_faults(self) -> FollowerParameters:
        counts: dict[FaultySensor, int] = {
            "microphones": len(self.robot.microphones_m),
            "ultrasonic": self.ultrasonic.count,
            "gas_sensors": GAS_SENSORS,
            "contact_switches": 2,
            "odometry": 1,
        }
        for sensor, count in counts.items():
            faults_of(self.faults, sensor, count)
        return self

    @property
    def own_guard(self) -> GuardParameters | None:
        """The guard of the robot, or None. A guarded law always has a guard."""
        if self.guard is None and self.law in LAWS and LAWS[self.law].guarded:
            return GuardParameters(obstacle_speed_m_s=0.6)
        return self.guard

    @property
    def listens(self) -> bool:
        """Whether the robot hears sound waves."""
        return self.hearing == "audio" and not self.has_goal

    @property
    def searches(self) -> Literal["odor", "sound"] | None:
        """What the robot searches for; None: it follows a source or a route."""
        return LAWS[self.law].searches if self.law in LAWS else None

    @property
    def has_goal(self) -> bool:
        """Whether the target is silent: the goal of a route, or an odor source."""
        return self.route is not None or self.searches == "odor"

    @property
    def follow_distance_m(self) -> float:
        """Distance between P and the target, m; 0 with a route."""
        return self.attraction.follow_distance_m if self.route is None else 0.0

    @property
    def size(self) -> tuple[float, float]:
        """Length and width of the robot, m."""
        return self.robot.length_m, self.robot.width_m


class SourceParameters(SourceRobotParameters):
    """One source: the leader that carries it, and its sound."""

    sound: SoundParameters = SoundParameters()
    """The sound of the source."""
    body: bool = True
    """Whether the source has a body that robots can hit and see; false: the source is
    only a sound."""
