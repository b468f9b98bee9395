"""Defines the fields of each robot and of each source in a scenario.

The control law of a robot determines the kind of the robot. Each kind has only the
fields that it uses.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from pydantic import (
    Discriminator,
    Field,
    SerializerFunctionWrapHandler,
    Strict,
    Tag,
    ValidationError,
    create_model,
    field_validator,
    model_serializer,
    model_validator,
)

from diagrams.scenario.suggestions import unknown_law
from systems.base.carrier_parameters import SourceRobotParameters
from systems.base.parameters import PlantParameters
from systems.base.robot import RobotParameters
from systems.framework.faults import Faults, FaultySensor, faults_of
from systems.framework.input_error import InputError
from systems.framework.parameters import Angle, Parameters, Point, SoundSpeed
from systems.heading.parameters import CompassParameters, MotorDriverParameters
from systems.hearing.parameters import (
    TDOAParameters,
    TrackerParameters,
)
from systems.laws.catalog import LAWS
from systems.laws.parameters import AttractionParameters, ImpedanceParameters
from systems.laws.trajectory.trajectory_conventional import (
    TrajectoryImpedanceParameters,
)
from systems.odor.parameters import (
    GAS_SENSORS,
    AirflowParameters,
    GasSensorParameters,
)
from systems.ranging.parameters import (
    CollisionVectorParameters,
    ObjectSensorParameters,
    UltrasonicParameters,
)
from systems.ranging.sensor_presets import on_body
from systems.routes.parameters import RouteParameters
from systems.safety.parameters import GuardParameters
from systems.search.parameters import PlumeSearchParameters, SoundSearchParameters
from systems.sound.parameters import MicArrayParameters, SoundParameters

#: Value of an argument of a user's own law or block.
OwnGain = Annotated[float, Field(ge=-1e12, le=1e12)]

#: Law of a robot that states none.
DEFAULT_LAW = "active"


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


class _LawGains(Parameters):
    @model_serializer(mode="wrap")
    def _dump(self, dump: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Leaves out the gains of laws that are neither set nor used."""
        return {k: v for k, v in dump(self).items() if k in self.model_fields_set}


if TYPE_CHECKING:

    class LawGains(_LawGains):
        """Stub for type checkers, which cannot see the fields from the catalog."""

        def __init__(self, **fields: Any) -> None: ...
        def __getattr__(self, name: str) -> Any: ...

else:
    LawGains = create_model(
        "LawGains",
        __base__=_LawGains,
        __module__=__name__,
        __doc__="Gains by law. Only the gains of the robot's law have an effect.",
        **{
            law.name: (
                law.gains,
                Field(law.gains(), description=f"Gains of ``law: {law.name}``."),
            )
            for law in LAWS.values()
            if law.gains is not None
        },
    )


class Robot(Parameters):
    """The fields that robots of all kinds have: law, body, wheels and start."""

    kind: ClassVar[str] = "robot"
    """Name of the kind, see ``KINDS``."""
    searches: ClassVar[Literal["odor", "sound"] | None] = None
    """What the robot searches for step by step; None: it does not search."""
    has_goal: ClassVar[bool] = False
    """Whether the target is silent: the goal of a route, or an odor source."""

    law: str = Field(default=DEFAULT_LAW, min_length=1)
    """Name of the control law. ``phonotaxis laws`` lists the names. The name of a
    user's own law is ``package.module:Name`` or ``path/to/file.py:Name``. The law
    determines the kind of the robot."""
    blocks: Annotated[tuple[str, ...], Strict(False), Field(max_length=32)] = ()
    """Names of a user's own blocks, as ``package.module:Name`` or
    ``path/to/file.py:Name``. Each block replaces the robot's block with the same part
    (role). A block with a new part is added."""
    own_gains: dict[str, OwnGain] = Field(default={})
    """Gains of a user's own law and blocks, by name. A gain is an argument with a
    number as its default: ``law(c, s, push_n=14.0)`` has the gain ``push_n``."""
    loudspeaker: SoundParameters | None = None
    """Sound that the robot itself plays at the origin of B, so that other robots can
    follow the robot. Its fields and defaults are those of ``sound``."""
    start: StartParameters = StartParameters()
    assumed_sound_speed_m_s: SoundSpeed | None = None
    """Speed of sound that hearing and range sensors assume, m/s; null: the true speed
    of sound."""
    robot: RobotParameters = RobotParameters()
    plant: PlantParameters = PlantParameters()
    faults: Faults = ()
    """Sensors that fail during a run."""

    @field_validator("law", "blocks", mode="before")
    @classmethod
    def _name_objects(cls, value: Any) -> Any:
        from diagrams.scenario.own_objects import with_names

        return with_names(value)

    @field_validator("law")
    @classmethod
    def _check_law(cls, law: str) -> str:
        if ":" not in law and law not in LAWS:
            raise unknown_law(law, LAWS)
        return law

    @model_validator(mode="after")
    def _check_faults(self) -> Robot:
        known = self.sensor_counts
        for index, fault in enumerate(self.faults):
            if fault.sensor not in known:
                raise InputError(
                    f"faults.{index}.sensor",
                    f"{fault.sensor} is not a sensor of this robot; use "
                    f"{' or '.join(known)}",
                )
        for sensor, count in known.items():
            faults_of(self.faults, sensor, count)
        return self

    @property
    def own_code(self) -> dict[str, str]:
        """Field of each law and block that is a user's own, by name."""
        named = [(self.law, "law"), *((block, "blocks") for block in self.blocks)]
        return {name: field for name, field in named if ":" in name}

    @property
    def sensor_counts(self) -> dict[FaultySensor, int]:
        """Number of sensors of each kind that can fail."""
        return {"odometry": 1}

    @property
    def own_guard(self) -> GuardParameters | None:
        """The guard of the robot; None without a guard."""
        return None

    @property
    def listens(self) -> bool:
        """Whether the robot hears sound waves."""
        return False

    @property
    def follow_distance_m(self) -> float:
        """Distance between P and the target, m."""
        return 0.0

    @property
    def size(self) -> tuple[float, float]:
        """Length and width of the robot, m."""
        return self.robot.length_m, self.robot.width_m


def _place_sensors(data: Any) -> Any:
    """Puts the sensors of a preset where the body of the robot has them."""
    if not isinstance(data, Mapping) or not isinstance(data.get("ultrasonic"), Mapping):
        return data
    try:
        body = RobotParameters.model_validate(data.get("robot", {}))
    except (ValidationError, InputError):  # the validation of the robot reports it
        return data
    placed = on_body(data["ultrasonic"], body.length_m, body.control_point_m)
    return {**data, "ultrasonic": placed}


class Follower(Robot):
    """A robot that follows a sound and avoids obstacles."""

    kind: ClassVar[str] = "follower"

    _place = model_validator(mode="before")(_place_sensors)

    hearing: Literal["audio", "ideal", "ideal_always"] = "audio"
    """``audio``: sound waves and microphones. ``ideal``: exact positions of the source
    while it sounds. ``ideal_always``: exact positions at all times."""
    obstacle_sensing: Literal["ultrasonic", "ideal"] = "ultrasonic"
    """``ultrasonic``: sensors with cones; ``ideal``: exact nearest points."""
    follows: str = ""
    """Name of the source or the leader to follow; empty: the first source."""
    microphones: MicArrayParameters = MicArrayParameters()
    tdoa: TDOAParameters = TDOAParameters()
    tracker: TrackerParameters = TrackerParameters()
    ultrasonic: UltrasonicParameters = UltrasonicParameters()
    collision_vector: CollisionVectorParameters = CollisionVectorParameters()
    attraction: AttractionParameters = AttractionParameters()
    laws: LawGains = LawGains()
    guard: GuardParameters | None = None
    """The guard limits the commands of any law, so that the robot stays in space that
    its sensors have seen as free. null: no guard, unless the law is ``guarded``."""

    @property
    def sensor_counts(self) -> dict[FaultySensor, int]:
        """Number of sensors of each kind that can fail."""
        return super().sensor_counts | {
            "microphones": len(self.robot.microphones_m),
            "ultrasonic": self.ultrasonic.count,
        }

    @property
    def gains(self) -> Any:
        """Gains of the robot's control law; None for a law without gains."""
        return getattr(self.laws, self.law, None)

    @property
    def own_guard(self) -> GuardParameters | None:
        """The guard of the robot, or None. A guarded law always has a guard."""
        guarded = self.law in LAWS and LAWS[self.law].guarded
        if self.guard is None and not guarded:
            return None
        guard = self.guard or GuardParameters()
        if guard.obstacle_speed_m_s is not None:
            return guard
        speed = self.gains.obstacle_speed_m_s if guarded else 0.0
        return guard.model_copy(update={"obstacle_speed_m_s": speed})

    @property
    def own_map(self) -> GuardParameters:
        """Parameters of the map: those of the guard, or the defaults without one."""
        return self.own_guard or GuardParameters()

    @property
    def listens(self) -> bool:
        """Whether the robot hears sound waves."""
        return self.hearing == "audio"

    @property
    def follow_distance_m(self) -> float:
        """Distance between P and the target, m."""
        return self.attraction.follow_distance_m


class Router(Robot):
    """A robot that drives to a goal on a planned route."""

    kind: ClassVar[str] = "router"
    has_goal: ClassVar[bool] = True

    obstacle_sensing: Literal["ultrasonic", "ideal"] = "ultrasonic"
    """``ultrasonic``: sensors with cones; ``ideal``: exact objects."""
    ultrasonic: UltrasonicParameters = UltrasonicParameters()
    route: RouteParameters
    impedance: ImpedanceParameters = ImpedanceParameters()
    laws: LawGains = LawGains()
    """Gains by law. Only the gains of the robot's law have an effect."""
    objects: ObjectSensorParameters = ObjectSensorParameters()

    _place = model_validator(mode="before")(_place_sensors)

    @model_validator(mode="before")
    @classmethod
    def _check_route(cls, data: Any) -> Any:
        if isinstance(data, Mapping) and data.get("route") is None:
            law = data.get("law")
            raise InputError(
                "route", f"is missing, and law {law!r} drives on one; set route.goal_m"
            )
        return data

    @property
    def sensor_counts(self) -> dict[FaultySensor, int]:
        """Number of sensors of each kind that can fail."""
        return super().sensor_counts | {"ultrasonic": self.ultrasonic.count}

    @cached_property
    def gains(self) -> Any:
        """Parameters of the control law: ``impedance`` and the law's own in ``laws``.

        A value that is null in ``impedance`` is the default of the law.
        """
        law = LAWS.get(self.law)
        model = (law and law.impedance) or TrajectoryImpedanceParameters
        given = {name: v for name, v in self.impedance if v is not None}
        return model(**given, **dict(getattr(self.laws, self.law, None) or ()))


class OdorSearcher(Robot):
    """A robot that searches for a source of odor."""

    kind: ClassVar[str] = "odor_searcher"
    searches: ClassVar[Literal["odor", "sound"] | None] = "odor"
    has_goal: ClassVar[bool] = True

    search: PlumeSearchParameters = PlumeSearchParameters()
    gas_sensors: GasSensorParameters = GasSensorParameters()
    airflow_sensors: AirflowParameters = AirflowParameters()
    compass: CompassParameters = CompassParameters()
    motor_driver: MotorDriverParameters = MotorDriverParameters()

    @property
    def sensor_counts(self) -> dict[FaultySensor, int]:
        """Number of sensors of each kind that can fail."""
        return super().sensor_counts | {
            "gas_sensors": GAS_SENSORS,
            "contact_switches": 2,
        }


class SoundSearcher(Robot):
    """A robot that searches for a sound step by step."""

    kind: ClassVar[str] = "sound_searcher"
    searches: ClassVar[Literal["odor", "sound"] | None] = "sound"

    follows: str = ""
    """Name of the source or the robot to search for; empty: the first source."""
    microphones: MicArrayParameters = MicArrayParameters()
    sound_search: SoundSearchParameters = SoundSearchParameters()
    compass: CompassParameters = CompassParameters()
    motor_driver: MotorDriverParameters = MotorDriverParameters()

    @property
    def sensor_counts(self) -> dict[FaultySensor, int]:
        """Number of sensors of each kind that can fail."""
        return super().sensor_counts | {"microphones": len(self.robot.microphones_m)}

    @property
    def listens(self) -> bool:
        """Whether the robot hears sound waves."""
        return True


#: The kinds of robots with microphones, and the kinds with range sensors.
HasMicrophones = Follower | SoundSearcher
HasRangeSensors = Follower | Router

#: Models of the kinds of robots, by name.
KINDS: Mapping[str, type[Robot]] = {
    model.kind: model for model in (Follower, Router, OdorSearcher, SoundSearcher)
}


def kind_of(robot: Any) -> str:
    """Returns the kind of a robot, a key of ``KINDS``.

    ``robot`` is a ``Robot`` or a mapping of plain values. The kind follows from the
    control law among its fields. With a user's own law, the robot is a router if its
    fields contain a route. A router drives on a route.
    """
    if isinstance(robot, Robot):
        return robot.kind
    fields = robot if isinstance(robot, Mapping) else {}
    law = fields.get("law", DEFAULT_LAW)
    if isinstance(law, str) and law in LAWS:
        return LAWS[law].robot
    return "follower" if fields.get("route") is None else "router"


#: A robot of any kind.
AnyRobot = Annotated[
    Annotated[Follower, Tag("follower")]
    | Annotated[Router, Tag("router")]
    | Annotated[OdorSearcher, Tag("odor_searcher")]
    | Annotated[SoundSearcher, Tag("sound_searcher")],
    Discriminator(kind_of),
]


class SourceParameters(SourceRobotParameters):
    """One source: the leader that carries the source, and the sound of the source."""

    sound: SoundParameters = SoundParameters()
    """The sound of the source."""
    body: bool = True
    """Whether the source has a body that robots can hit and see; false: the source is
    only a point, and a sound."""
