"""The scenario: everything that a run depends on, in one tree.

The tree is made of the blocks' own parameter models, so that a quantity has
one name, one default and one legal range. See ``load_scenario`` for YAML.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field, Strict, model_validator

from systems.base.carrier import DrivenPath
from systems.base.diff_drive_plant import PlantParameters
from systems.base.robot import RobotParameters
from systems.base.source_robot import SourceRobotParameters
from systems.base.wheel_odometry import OdometryParameters
from systems.framework.input_error import InputError
from systems.framework.parameters import (
    Angle,
    Duration,
    Fraction,
    Length,
    NonNegative,
    Parameters,
    Point,
    Size,
    Speed,
)
from systems.hearing.ideal_source_sensor import IdealHearingParameters
from systems.hearing.tdoa_estimator import TDOAParameters
from systems.hearing.tracker_model import TrackerParameters
from systems.laws.impedance import AttractionParameters
from systems.laws.repulsion import RepulsionParameters
from systems.ranging.collision_vector import CollisionVectorParameters
from systems.ranging.ultrasonic_array import UltrasonicParameters
from systems.sound.acoustics import AcousticParameters
from systems.sound.adc import MicArrayParameters, channel_skew
from systems.sound.interferers import InterfererParameters
from systems.sound.mic_array import microphones_B
from systems.sound.room import RoomParameters
from systems.sound.waveforms import SoundParameters
from systems.world.geometry import rectangle_clearance, rotate
from systems.world.obstacles import ObstacleParameters
from systems.world.paths import WaypointPath

__all__ = ["Body", "Scenario", "StartParameters", "StopParameters"]


class StartParameters(Parameters):
    """Where the robot starts, at rest."""

    position_m: Point = (0.0, 0.0)
    """Origin of B in W, m."""
    heading_deg: Angle = 0.0
    """Heading, deg CCW from the x axis of W."""

    @property
    def pose(self) -> tuple[float, float, float]:
        """(x, y, theta), m and rad."""
        return (*self.position_m, math.radians(self.heading_deg))


class StopParameters(Parameters):
    """When a run ends, and what counts as following."""

    goal_margin_m: Length = 0.3
    """Goal of a resting source: P within the follow distance plus this, m."""
    rest_speed_m_s: Speed = 0.05
    """At rest: P is slower than this, m/s."""
    rest_time_s: Duration = 1.0
    """Reached: P is in the goal and at rest for so long without a break, s."""
    following_band_m: Length = 0.8
    """Following: P is this near to the follow distance, m."""
    following_share: Fraction = 0.5
    """Completed: P follows in this share of the time since the first detection."""
    stuck_after_s: Duration = 10.0
    """Stuck: P stays within ``stuck_radius_m`` for so long, outside of its goal."""
    stuck_radius_m: Length = 0.1
    """See ``stuck_after_s``, m."""
    lost_after_s: Duration = 20.0
    """Lost: no valid target for so long, s."""
    diverged_range_m: Length = 20.0
    """Diverged: the source is farther away than this, m."""


class IntegratorParameters(Parameters):
    """How Drake integrates the plant, with a fixed step."""

    scheme: Literal["runge_kutta2", "runge_kutta3", "runge_kutta5"] = "runge_kutta3"
    """Nothing changes between ticks but the motor lag's decay: one third-order
    step a tick stays within 20 um of the true path over 20 s."""
    step_s: float = Field(default=0.025, ge=1e-5, le=0.025)
    """Largest step, s."""


class Body(NamedTuple):
    """A rectangle that moves along a path."""

    path: WaypointPath | DrivenPath
    """Pose of its centre over time."""
    size: tuple[float, float]
    """Length and width, m."""

    def rectangle(self, time: float) -> NDArray[np.float64]:
        """(5,) x, y, theta, length, width in W at a time in s."""
        return np.array([*self.path.pose(time), *self.size])

    def rectangles(self, times: ArrayLike) -> NDArray[np.float64]:
        """(n, 5) rectangles at many times at once."""
        poses = self.path.poses(times)
        return np.hstack([poses, np.tile(np.array(self.size), (len(poses), 1))])


class Scenario(Parameters):
    """One run. Every field has a default: the default scenario is complete."""

    name: str = Field(default="default", min_length=1, pattern=r"\A[^\n]*\z")
    """Name in results."""
    description: str = Field(default="", pattern=r"\A[^\n]*\z")
    """One line for ``phonotaxis scenarios``."""
    seed: int = Field(default=1, ge=0, lt=2**63)
    """Every random number of the run comes from it."""
    duration_s: float = Field(default=40.0, ge=1e-9, le=3_600.0)
    """Longest simulated time, s; an hour at most."""
    arena_m: Size = (7.0, 7.0)
    """Extents of the floor in pictures, m; it has no walls."""
    law: str = Field(default="active", min_length=1)
    """``none``, ``conventional``, ``active`` (2019), ``conventional2017``,
    ``active2017``, or ``package.module:Name``."""
    hearing: Literal["audio", "ideal"] = "audio"
    """Sound waves and microphones, or exact positions."""
    obstacle_sensing: Literal["ultrasonic", "ideal"] = "ultrasonic"
    """Cones, or exact nearest points."""

    start: StartParameters = StartParameters()
    source: SourceRobotParameters = SourceRobotParameters()
    obstacles: Annotated[
        tuple[ObstacleParameters, ...], Strict(False), Field(max_length=100)
    ] = ()
    stop: StopParameters = StopParameters()

    acoustics: AcousticParameters = AcousticParameters()
    sound: SoundParameters = SoundParameters()
    room: RoomParameters | None = None
    interferers: Annotated[
        tuple[InterfererParameters, ...], Strict(False), Field(max_length=16)
    ] = ()
    microphones: MicArrayParameters = MicArrayParameters()
    tdoa: TDOAParameters = TDOAParameters()
    ideal_hearing: IdealHearingParameters = IdealHearingParameters()
    tracker: TrackerParameters = TrackerParameters()
    ultrasonic: UltrasonicParameters = UltrasonicParameters()
    collision_vector: CollisionVectorParameters = CollisionVectorParameters()
    attraction: AttractionParameters = AttractionParameters()
    repulsion: RepulsionParameters = RepulsionParameters()
    robot: RobotParameters = RobotParameters()
    plant: PlantParameters = PlantParameters()
    odometry: OdometryParameters = OdometryParameters()
    integrator: IntegratorParameters = IntegratorParameters()

    @property
    def source_size(self) -> tuple[float, float]:
        """Length and width of the master robot, m."""
        return self.source.length_m, self.source.width_m

    def bodies(self) -> dict[str, Body]:
        """All that the robot can hit, by name: the obstacles, then ``source``."""
        bodies = {o.name: Body(o.path(), o.size_m) for o in self.obstacles}
        bodies["source"] = Body(self.source.path(), self.source_size)
        return bodies

    @property
    def goal_radius_m(self) -> NonNegative:
        """P is in the goal within this distance of the source, m.

        Of a moving source the goal is as wide as the following band.
        """
        moves = self.source.path().moves
        margin = self.stop.following_band_m if moves else self.stop.goal_margin_m
        return self.attraction.follow_distance_m + margin

    @model_validator(mode="after")
    def _check_step(self) -> Scenario:
        # Where explicit Runge-Kutta steps of these orders amplify a decay.
        limits = {"runge_kutta2": 2.0, "runge_kutta3": 2.51, "runge_kutta5": 3.3}
        lag, step = self.plant.motor_lag_s, self.integrator.step_s
        if lag < step / limits[self.integrator.scheme]:
            raise InputError(
                "plant.motor_lag_s",
                f"{lag} s is too short for steps of {step} s, which "
                f"would be unstable; set integrator.step_s to {lag:g} or less",
            )
        return self

    @model_validator(mode="after")
    def _check_channels(self) -> Scenario:
        channel_skew(self.microphones, len(self.robot.microphones_m))
        return self

    @model_validator(mode="after")
    def _check_names(self) -> Scenario:
        names = [obstacle.name for obstacle in self.obstacles]
        for name in names:
            if names.count(name) > 1 or name == "source":
                raise InputError(
                    "obstacles",
                    f"the name {name!r} is taken; give each obstacle a "
                    "name of its own, other than 'source'",
                )
        return self

    @model_validator(mode="after")
    def _check_interferers(self) -> Scenario:
        names = [interferer.name for interferer in self.interferers]
        for name in names:
            if names.count(name) > 1:
                raise InputError(
                    "interferers",
                    f"the name {name!r} is taken; give each interferer a "
                    "name of its own",
                )
        return self

    @model_validator(mode="after")
    def _check_room(self) -> Scenario:
        if self.room is None:
            return self
        self.room.walls(self.acoustics.c)
        x, y, theta = self.start.pose
        dx, dy = rotate(theta, *microphones_B(self.robot).T)
        places = {
            "source.waypoints_m": self.source.waypoints_m,
            "start.position_m": np.column_stack([x + dx, y + dy]),
        }
        for k, interferer in enumerate(self.interferers):
            places[f"interferers.{k}.waypoints_m"] = interferer.waypoints_m
        for field, points in places.items():
            what = ", a microphone," if field == "start.position_m" else ""
            for point in points:
                if not self.room.contains(point):
                    raise InputError(
                        field,
                        f"({point[0]:g}, {point[1]:g}){what} is outside the room, "
                        f"which begins at {tuple(self.room.corner.tolist())} and is "
                        f"{self.room.size_m} m; set room.corner_m or room.size_m",
                    )
        return self

    @model_validator(mode="after")
    def _check_start(self) -> Scenario:
        footprint = robot_rectangle(self.start.pose, self.robot)
        fields = [f"obstacles.{k}" for k in range(len(self.obstacles))]
        for field, (name, body) in zip(
            [*fields, "source"], self.bodies().items(), strict=True
        ):
            if rectangle_clearance(footprint, body.rectangle(0.0)) < 0.0:
                raise InputError(
                    field,
                    f"{name!r} stands on the robot's start at {self.start.position_m}; "
                    "move its first waypoint or start.position_m",
                )
        return self


def robot_rectangle(pose_WB: ArrayLike, robot: RobotParameters) -> NDArray[np.float64]:
    """The robot's footprint: a rectangle centred on the origin of B."""
    x, y, theta = np.asarray(pose_WB)
    return np.array([x, y, theta, robot.length_m, robot.width_m])
